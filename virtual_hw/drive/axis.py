"""The CiA 402 axis of a drive: what the firmware does on each servo tick."""

from __future__ import annotations

import math

from config.schema import Joint
from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.emergency import Emergencies, ErrorCode
from virtual_hw.drive.motion import INTERNAL_LIMIT, Motion
from virtual_hw.drive.objects import ObjectStore
from virtual_hw.drive.servo import Mode
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
_ALWAYS = _VOLTAGE_ENABLED | _REMOTE
_RUN = 0x000F
"""The controlword of an axis that is enabled and told nothing else."""

_STAYING_QUICK_STOPS = (5, 6, 7, 8)
_BLOCKING = frozenset({ErrorCode.HEARTBEAT_LOST, 0x8120})
"""Communication errors after which the drive cannot be enabled or reset before NMT reset communication."""


class Axis:
    """State machine and mode of one axis; `motion` moves it.

    `tick` takes what the drive senses and gives the torque it demands. All in the drive's own direction: counts,
    counts/s, N·m at the joint; the installation's `rated_torque_nm` is 1000 ‰.
    """

    def __init__(self, store: ObjectStore, joint: Joint, tick_ns: int, emergencies: Emergencies) -> None:
        self.state = PowerState.SWITCH_ON_DISABLED
        self.brake = True
        """Whether the holding brake is applied."""
        self.motion = Motion(store, joint, tick_ns)
        self._values = store.values
        self._emergencies = emergencies
        self._torque = 0.0
        self._stopping_to: PowerState | None = None
        self._halted = False
        self._quick_stop_option = 0
        self._reset_bit = True
        self._commanded = False
        self.fault_stands = False
        """Whether the cause of the present fault is still there, so that it cannot be reset."""
        self.abort_options = {2: 2, 3: 3}
        """What 6007 means to this drive; some vendors swap "disable voltage" (2) and "quick stop" (3)."""
        slot = store.slot
        self._controlword, self._statusword = slot(0x6040), slot(0x6041)
        self._mode_set, self._mode = slot(0x6060), slot(0x6061)
        self._position, self._speed = slot(0x6064), slot(0x606C)
        self._supported = slot(0x6502)
        self._options = {index: slot(index) for index in (0x6007, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E)}
        store.guards[0x6060, 0] = self._guard_mode
        store.effects[0x6060, 0] = lambda _: self.select_mode()
        store.effects[0x6040, 0] = lambda _: self.new_command()
        self.power_on()

    def power_on(self) -> None:
        """Begin as after a reset: without torque, brake applied, all from the object store."""
        self.state = PowerState.SWITCH_ON_DISABLED
        self.brake = True
        self._torque = 0.0
        self._stopping_to = None
        self._halted = False
        self._reset_bit = True
        self.motion.configure()
        self.select_mode()
        self._show(0)

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
        option = self.abort_options.get(self._option(0x6007))
        self._commanded = False
        if self.state is not PowerState.OPERATION_ENABLED:
            return
        if option == 2:
            self._power_off(PowerState.SWITCH_ON_DISABLED)
        elif option == 3:
            self._quick_stop()

    def cut_torque(self) -> None:
        """The safety circuit takes the torque away (STO); the drive sees its power stage off."""
        self._power_off(PowerState.SWITCH_ON_DISABLED)

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
        if self.state is not PowerState.OPERATION_ENABLED:
            self._command_disabled(decode(controlword), controlword)
        elif controlword != _RUN or self._halted or self._stopping_to is not None or self._reset_bit:
            self._command_enabled(decode(controlword), controlword)
        status = 0
        torque = 0.0
        if self.state in ENERGISED:
            torque, status = self._control(counts, velocity)
        self._commanded = False
        self._torque = torque
        self._show(status)
        return torque

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
            if rising and not self.blocked and not self.fault_stands:
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

    def _begin_following(self) -> None:
        self._halted = False
        self._stopping_to = None
        self.motion.begin_following()

    def _begin_stop(self, option: int) -> None:
        self.motion.begin_stop(option, self._torque)

    def _control(self, counts: int, velocity: float) -> tuple[float, int]:
        """(torque, status bits) of an energised state; leaves it on a fault, or when a stop has come to rest."""
        motion = self.motion
        if self.state is PowerState.OPERATION_ENABLED and self._stopping_to is None and not self._halted:
            torque, status = motion.follow(counts, velocity)
            if motion.fault is not None:
                self.fault(motion.fault)
        else:
            torque, resting = motion.stop(counts, velocity)
            status = _TARGET_REACHED if resting else 0
            if resting:
                self._came_to_rest()
        if self.state not in ENERGISED:
            return 0.0, 0
        limit = motion.limit_nm
        if abs(torque) > limit:
            return math.copysign(limit, torque), status | INTERNAL_LIMIT
        return torque, status

    def _came_to_rest(self) -> None:
        if self.state is PowerState.FAULT_REACTION_ACTIVE:
            self._power_off(PowerState.FAULT)  # 14
        elif self.state is PowerState.QUICK_STOP_ACTIVE:
            if self._quick_stop_option not in _STAYING_QUICK_STOPS:
                self._power_off(PowerState.SWITCH_ON_DISABLED)  # 12
        elif self._stopping_to is not None:
            self._power_off(self._stopping_to)  # 5, 8

    def _option(self, index: int) -> int:
        return self._values[self._options[index]]

    def _supports(self, mode: int) -> bool:
        return mode == Mode.NONE or (mode in tuple(Mode) and bool(self._values[self._supported] >> mode - 1 & 1))

    def _guard_mode(self, value: int) -> None:
        if not self._supports(value):
            raise SdoAbort(Abort.VALUE)
