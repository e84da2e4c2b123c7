"""The CiA 402 axis of a drive: what the firmware does on each servo tick."""

from __future__ import annotations

import math
from collections.abc import Callable

from config.schema import Joint
from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.emergency import Emergencies, ErrorCode
from virtual_hw.drive.objects import ObjectStore
from virtual_hw.drive.servo import SETTLE_NS, Mode, Servo
from virtual_hw.drive.states import (
    DE_ENERGISED_TRANSITIONS,
    ENERGISED,
    FAULT_RESET,
    HALT,
    Command,
    PowerState,
    decode,
)

_VOLTAGE_ENABLED = 0x0010
_REMOTE = 0x0200
_TARGET_REACHED = 0x0400
_INTERNAL_LIMIT = 0x0800
_FOLLOWING = 0x1000
_FOLLOWING_ERROR = 0x2000
_ALWAYS = _VOLTAGE_ENABLED | _REMOTE
_RUN = 0x000F
"""The controlword of an axis that is enabled and told nothing else."""
_UNSUPERVISED = 0xFFFF_FFFF

_STAYING_QUICK_STOPS = (5, 6, 7, 8)
_BLOCKING = frozenset({ErrorCode.HEARTBEAT_LOST, 0x8120})
"""Communication errors after which the drive cannot be enabled or reset before NMT reset communication."""


class Axis:
    """State machine, mode, limits and servo of one axis.

    `tick` takes what the drive senses and gives the torque it demands. All in the drive's own direction: counts,
    counts/s, N·m at the joint; the installation's `rated_torque_nm` is 1000 ‰.
    """

    def __init__(self, store: ObjectStore, joint: Joint, tick_ns: int, emergencies: Emergencies) -> None:
        self.state = PowerState.SWITCH_ON_DISABLED
        self.brake = True
        """Whether the holding brake is applied."""
        self.velocity_offset_mapped: Callable[[], bool] = lambda: False
        """Whether the host commands 60B1; without it the velocity reference is the slope of 607A."""
        self._store, self._values = store, store.values
        self._emergencies = emergencies
        self._tick_ns = tick_ns
        self._rated_nm = joint.rated_torque_nm
        self._servo = Servo(joint.encoder.counts_per_turn, tick_ns)
        self._torque = 0.0
        self._stop_deceleration = math.inf
        self._rest_ns = 0
        self._stopping_to: PowerState | None = None
        self._halted = False
        self._quick_stop_option = 0
        self._reset_bit = True
        self._following_ns = 0
        self._fresh = self._commanded = False
        self._limited = False
        slot = store.slot
        self._controlword, self._statusword = slot(0x6040), slot(0x6041)
        self._mode_set, self._mode = slot(0x6060), slot(0x6061)
        self._position, self._speed = slot(0x6064), slot(0x606C)
        self._target_torque, self._max_torque = slot(0x6071), slot(0x6072)
        self._target_position = slot(0x607A)
        self._low, self._high = slot(0x607D, 1), slot(0x607D, 2)
        self._max_speed = slot(0x6080)
        self._velocity_offset, self._torque_offset = slot(0x60B1), slot(0x60B2)
        self._target_velocity = slot(0x60FF)
        self._window, self._window_ms = slot(0x6065), slot(0x6066)
        self._options = {index: slot(index) for index in (0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E)}
        self._profile_deceleration, self._quick_deceleration = slot(0x6084), slot(0x6085)
        store.guards[0x6060, 0] = self._guard_mode
        store.effects[0x6060, 0] = lambda _: self.select_mode()
        store.effects[0x6040, 0] = lambda _: self.new_command()
        store.effects[0x607A, 0] = lambda _: self.new_setpoint()
        for subindex in (1, 2):
            store.effects[0x2100, subindex] = lambda _: self._take_gains()
            store.effects[0x60C2, subindex] = lambda _: self._take_period()
        store.sources[0x60F4, 0] = self._following_error
        self.power_on()

    def power_on(self) -> None:
        """Begin as after a reset: without torque, brake applied, all from the object store."""
        self.state = PowerState.SWITCH_ON_DISABLED
        self.brake = True
        self._torque = 0.0
        self._stopping_to = None
        self._halted = False
        self._reset_bit = True
        self._take_gains()
        self._take_period()
        self.select_mode()
        self._show(0)

    def new_setpoint(self) -> None:
        """The host's targets are valid from now on; taken up on the next tick."""
        self._fresh = True

    def new_command(self) -> None:
        """The host has sent a controlword: only a new one, not the old one still standing, leaves a quick stop."""
        self._commanded = True

    def select_mode(self) -> None:
        """Take up 6060 where it is a supported mode, and display it in 6061."""
        values = self._values
        wanted = values[self._mode_set]
        if wanted != values[self._mode] and self._supports(wanted):
            values[self._mode] = wanted
            if self.state is PowerState.OPERATION_ENABLED:
                self._begin_following()

    def fault(self, code: int) -> None:
        """A fault: announce it, stop as 605E says, and stay in the fault state (transitions 13, 14)."""
        self._emergencies.raise_error(code)
        if self.faulty:
            return
        option = self._option(0x605E)
        if self.state in ENERGISED and option != 0:
            self._begin_stop(option)
            self.state = PowerState.FAULT_REACTION_ACTIVE
        else:
            self._power_off(PowerState.FAULT)

    def connection_lost(self, code: int) -> None:
        """The connection to the host is lost: announce it and do what 6007 says, where there is torque to stop."""
        if self._option(0x6007) == 1:
            self.fault(code)
        else:
            self._emergencies.raise_error(code)
            self._abort_motion()

    def disconnect(self) -> None:
        """The host stopped or reset this node's communication: as a lost connection, without an error of its own."""
        if self._option(0x6007) == 1 and self.state in ENERGISED:
            self.fault(ErrorCode.COMMUNICATION)
        else:
            self._abort_motion()

    def _abort_motion(self) -> None:
        option = self._option(0x6007)
        self._commanded = False
        if self.state is not PowerState.OPERATION_ENABLED:
            return
        if option == 2:
            self._power_off(PowerState.SWITCH_ON_DISABLED)
        elif option == 3:
            self._quick_stop()

    def sense(self, counts: int, velocity: float) -> None:
        """Show what the sensors say in 6064 and 606C."""
        self._values[self._position] = counts
        self._values[self._speed] = round(velocity)

    def tick(self, counts: int, velocity: float) -> float:
        """One servo tick.

        Args:
            counts: position as sensed.
            velocity: velocity as sensed, counts/s.

        Returns:
            Torque demand, N·m.
        """
        values = self._values
        values[self._position] = counts
        values[self._speed] = round(velocity)
        controlword = values[self._controlword]
        command = decode(controlword)
        if self.state is not PowerState.OPERATION_ENABLED:
            self._command_disabled(command, controlword)
        elif controlword != _RUN or self._halted or self._stopping_to is not None or self._reset_bit:
            self._command_enabled(command, controlword)
        status = 0
        torque = 0.0
        if self.state in ENERGISED:
            torque, status = self._control(counts, velocity)
        self._fresh = self._commanded = False
        self._torque = torque
        self._show(status)
        return torque

    # --- state machine

    def _command_enabled(self, command: Command, controlword: int) -> None:
        self._reset_bit = bool(controlword & FAULT_RESET)
        if command is Command.DISABLE_VOLTAGE:  # 9
            self._power_off(PowerState.SWITCH_ON_DISABLED)
        elif command is Command.QUICK_STOP:  # 11
            self._quick_stop()
        elif command is Command.ENABLE_OPERATION:
            if self._stopping_to is not None:
                self._stopping_to = None
                self._begin_following()
            self._halt(bool(controlword & HALT))
        else:
            option, goal = (
                (self._option(0x605B), PowerState.READY_TO_SWITCH_ON)  # 8
                if command is Command.SHUTDOWN
                else (self._option(0x605C), PowerState.SWITCHED_ON)  # 5
            )
            if option == 0:
                self._power_off(goal)
            elif self._stopping_to is None:
                self._begin_stop(1)
                self._stopping_to = goal
            else:
                self._stopping_to = goal

    def _command_disabled(self, command: Command, controlword: int) -> None:
        reset = bool(controlword & FAULT_RESET)
        rising, self._reset_bit = reset and not self._reset_bit, reset
        if self.state is PowerState.FAULT:
            if rising and not self.blocked:
                self._emergencies.clear(*self._emergencies.present)
                self.state = PowerState.SWITCH_ON_DISABLED  # 15
            return
        if self.state is PowerState.QUICK_STOP_ACTIVE:
            if command is Command.DISABLE_VOLTAGE:
                self._power_off(PowerState.SWITCH_ON_DISABLED)  # 12
            elif command is Command.ENABLE_OPERATION and self._may_resume():
                self.state = PowerState.OPERATION_ENABLED  # 16
                self._begin_following()
            return
        goal = DE_ENERGISED_TRANSITIONS.get((self.state, command))
        if goal is None or (goal is PowerState.OPERATION_ENABLED and self._refuses_to_enable()):
            return
        self.state = goal
        if goal is PowerState.OPERATION_ENABLED:
            self.brake = False
            self._torque = 0.0
            self._begin_following()

    @property
    def blocked(self) -> bool:
        """Whether a communication error stands that only NMT reset communication removes."""
        return not _BLOCKING.isdisjoint(self._emergencies.present)

    @property
    def faulty(self) -> bool:
        return self.state in (PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE)

    def _refuses_to_enable(self) -> bool:
        return self.blocked or self._values[self._mode] == Mode.NONE

    def _may_resume(self) -> bool:
        return self._commanded and self._quick_stop_option in _STAYING_QUICK_STOPS and not self._refuses_to_enable()

    def _quick_stop(self) -> None:
        self._quick_stop_option = self._option(0x605A)
        if self._quick_stop_option == 0:
            self._power_off(PowerState.SWITCH_ON_DISABLED)
            return
        self._begin_stop((self._quick_stop_option - 1) % 4 + 1)
        self.state = PowerState.QUICK_STOP_ACTIVE

    def _halt(self, wanted: bool) -> None:
        if wanted and not self._halted:
            self._begin_stop(self._option(0x605D))
        elif self._halted and not wanted:
            self._begin_following()
        self._halted = wanted

    def _power_off(self, state: PowerState) -> None:
        self.state = state
        self.brake = True
        self._stopping_to = None
        self._halted = False

    def _show(self, status: int) -> None:
        self._values[self._statusword] = self.state | _ALWAYS | status

    # --- motion

    def _begin_following(self) -> None:
        self._halted = False
        self._stopping_to = None
        self._following_ns = 0
        self._servo.rest_at(self._values[self._position])

    def _begin_stop(self, option: int) -> None:
        """Start stopping: option 1 slows down on the profile ramp, 2 on the quick-stop ramp, 3 and 4 at the limits."""
        values = self._values
        slot = {1: self._profile_deceleration, 2: self._quick_deceleration}.get(option)
        self._stop_deceleration = math.inf if slot is None else float(values[slot])
        self._rest_ns = 0
        self._servo.begin_stop(values[self._position], values[self._speed], self._torque)

    def _control(self, counts: int, velocity: float) -> tuple[float, int]:
        """(torque, status bits) of an energised state; leaves it when a stop has come to rest."""
        values = self._values
        limit = self._rated_nm * values[self._max_torque] * 1e-3
        status = 0
        if self.state is PowerState.OPERATION_ENABLED and self._stopping_to is None and not self._halted:
            torque, status = self._follow(counts, velocity)
        else:
            torque = self._servo.stop(self._stop_deceleration, counts, velocity, limit)
            if self._servo.velocity == 0.0:
                self._rest_ns += self._tick_ns
            if self._rest_ns >= SETTLE_NS:
                status = _TARGET_REACHED
                self._came_to_rest()
        if self.state not in ENERGISED:
            return 0.0, 0
        if abs(torque) > limit:
            return math.copysign(limit, torque), status | _INTERNAL_LIMIT
        return torque, status

    def _came_to_rest(self) -> None:
        if self.state is PowerState.FAULT_REACTION_ACTIVE:
            self._power_off(PowerState.FAULT)  # 14
        elif self.state is PowerState.QUICK_STOP_ACTIVE:
            if self._quick_stop_option not in _STAYING_QUICK_STOPS:
                self._power_off(PowerState.SWITCH_ON_DISABLED)  # 12
        elif self._stopping_to is not None:
            self._power_off(self._stopping_to)  # 5, 8

    def _follow(self, counts: int, velocity: float) -> tuple[float, int]:
        values = self._values
        offset = values[self._torque_offset] * 1e-3 * self._rated_nm
        mode = values[self._mode]
        if mode == Mode.CSP:
            return self._follow_position(counts, velocity, offset)
        low, high = values[self._low], values[self._high]
        if low < high and not low <= counts <= high:
            self.fault(ErrorCode.REFERENCE_LIMIT)
            return (self._servo.stop(self._stop_deceleration, counts, velocity, math.inf), 0)
        top = values[self._max_speed]
        if mode == Mode.CST:
            torque = values[self._target_torque] * 1e-3 * self._rated_nm + offset
            if abs(velocity) > top and torque * velocity > 0.0:
                return 0.0, _FOLLOWING | _INTERNAL_LIMIT
            return torque, _FOLLOWING
        target = values[self._target_velocity] + values[self._velocity_offset]
        status = _FOLLOWING
        if abs(target) > top:
            target, status = int(math.copysign(top, target)), status | _INTERNAL_LIMIT
        return self._servo.follow_velocity(target, offset, counts, velocity), status

    def _follow_position(self, counts: int, velocity: float, offset: float) -> tuple[float, int]:
        values, servo = self._values, self._servo
        status = _FOLLOWING
        if self._fresh:
            target = values[self._target_position]
            low, high = values[self._low], values[self._high]
            if low < high and not low <= target <= high:
                target, self._limited = (low if target < low else high), True
            else:
                self._limited = False
            servo.aim(target, values[self._velocity_offset] if self.velocity_offset_mapped() else None, offset)
        if self._limited:
            status |= _INTERNAL_LIMIT
        torque = servo.follow(counts, velocity)
        window = values[self._window]
        if window != _UNSUPERVISED and abs(servo.position - counts) > window:
            status |= _FOLLOWING_ERROR
            self._following_ns += self._tick_ns
            if self._following_ns > values[self._window_ms] * 1_000_000:
                self.fault(ErrorCode.FOLLOWING_ERROR)
        else:
            self._following_ns = 0
        return torque, status

    # --- objects

    def _option(self, index: int) -> int:
        return self._values[self._options[index]]

    def _supports(self, mode: int) -> bool:
        return mode in (Mode.CSP, Mode.CSV, Mode.CST) or mode == Mode.NONE

    def _guard_mode(self, value: int) -> None:
        if not self._supports(value):
            raise SdoAbort(Abort.VALUE)

    def _take_gains(self) -> None:
        store = self._store
        self._servo.set_gains(store.values[store.slot(0x2100, 1)], store.values[store.slot(0x2100, 2)])

    def _take_period(self) -> None:
        store = self._store
        value, exponent = store.values[store.slot(0x60C2, 1)], store.values[store.slot(0x60C2, 2)]
        self._servo.set_period(min(value * 10.0**exponent, 1.0))

    def _following_error(self) -> int:
        return round(self._servo.position) - self._values[self._position]
