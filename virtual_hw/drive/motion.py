"""How an energised axis moves: it follows its targets in one of the cyclic modes within its limits, or stops."""

from __future__ import annotations

import math

from config.schema import Joint
from virtual_hw.drive.emergency import ErrorCode
from virtual_hw.drive.objects import ObjectStore
from virtual_hw.drive.servo import SETTLE_NS, Mode, Servo

INTERNAL_LIMIT = 0x0800
FOLLOWING = 0x1000
FOLLOWING_ERROR = 0x2000
"""Bits of the statusword that motion sets."""
_UNSUPERVISED = 0xFFFF_FFFF


class Motion:
    """The servo with the objects that command and limit it; all in the drive's own direction and units."""

    def __init__(self, store: ObjectStore, joint: Joint, tick_ns: int) -> None:
        self.servo = Servo(joint.encoder.counts_per_turn, tick_ns)
        self.velocity_offset_mapped = False
        """Whether the host commands 60B1; without it the velocity reference is the slope of 607A."""
        self.fault: ErrorCode | None = None
        """What went wrong in the last `follow`."""
        self._store, self._values = store, store.values
        self._tick_ns = tick_ns
        self._nm = joint.rated_torque_nm * 1e-3
        """N·m a permille."""
        self._deceleration = math.inf
        self._rest_ns = 0
        self._astray_ns = 0
        self._fresh = False
        self._limited = False
        slot = store.slot
        self._mode = slot(0x6061)
        self._position, self._speed = slot(0x6064), slot(0x606C)
        self._target_torque, self._max_torque = slot(0x6071), slot(0x6072)
        self._target_position, self._target_velocity = slot(0x607A), slot(0x60FF)
        self._low, self._high = slot(0x607D, 1), slot(0x607D, 2)
        self._max_speed = slot(0x6080)
        self._velocity_offset, self._torque_offset = slot(0x60B1), slot(0x60B2)
        self._window, self._window_ms = slot(0x6065), slot(0x6066)
        self._profile_deceleration, self._quick_deceleration = slot(0x6084), slot(0x6085)
        store.effects[0x607A, 0] = lambda _: self.new_setpoint()
        for subindex in (1, 2):
            store.effects[0x2100, subindex] = lambda _: self._take_gains()
            store.effects[0x60C2, subindex] = lambda _: self._take_period()
        store.sources[0x60F4, 0] = self._following_error
        self.configure()

    def configure(self) -> None:
        """Take up gains and interpolation period from the object store."""
        self._take_gains()
        self._take_period()

    def new_setpoint(self) -> None:
        """The host's targets are valid from now on; taken up on the next tick."""
        self._fresh = True

    @property
    def limit_nm(self) -> float:
        """Object 6072."""
        return self._nm * self._values[self._max_torque]

    def begin_following(self) -> None:
        """Start following targets from where the axis is."""
        self._astray_ns = 0
        self._limited = False
        self.servo.rest_at(self._values[self._position])

    def follow(self, counts: int, velocity: float) -> tuple[float, int]:
        """One tick of the mode of operation: (torque N·m, status bits); what went wrong stands in `fault`."""
        values = self._values
        self.fault = None
        offset = values[self._torque_offset] * self._nm
        mode = values[self._mode]
        if mode == Mode.CSP:
            result = self._follow_position(counts, velocity, offset)
        else:
            low, high = values[self._low], values[self._high]
            if low < high and not low <= counts <= high:
                self.fault = ErrorCode.REFERENCE_LIMIT
            if mode == Mode.CST:
                result = self._follow_torque(velocity, offset)
            else:
                result = self._follow_velocity(counts, velocity, offset)
        self._fresh = False
        return result

    def begin_stop(self, option: int, torque_nm: float) -> None:
        """Start stopping, from the present torque: option 1 slows down on the profile ramp, 2 on the quick-stop ramp,
        3 and 4 at the torque limit (the codes of 605A, 605D and 605E).
        """
        values = self._values
        slot = {1: self._profile_deceleration, 2: self._quick_deceleration}.get(option)
        self._deceleration = math.inf if slot is None else float(values[slot])
        self._rest_ns = 0
        self.servo.begin_stop(values[self._position], values[self._speed], torque_nm)

    def stop(self, counts: int, velocity: float) -> tuple[float, bool]:
        """One tick of stopping: (torque N·m, whether the axis has come to rest)."""
        torque = self.servo.stop(self._deceleration, counts, velocity, self.limit_nm)
        if self.servo.velocity == 0.0:
            self._rest_ns += self._tick_ns
        return torque, self._rest_ns >= SETTLE_NS

    def _follow_position(self, counts: int, velocity: float, offset: float) -> tuple[float, int]:
        values, servo = self._values, self.servo
        if self._fresh:
            target = values[self._target_position]
            low, high = values[self._low], values[self._high]
            self._limited = low < high and not low <= target <= high
            if self._limited:
                target = low if target < low else high
            servo.aim(target, values[self._velocity_offset] if self.velocity_offset_mapped else None, offset)
        status = FOLLOWING | INTERNAL_LIMIT if self._limited else FOLLOWING
        torque = servo.follow(counts, velocity)
        window = values[self._window]
        if window == _UNSUPERVISED or abs(servo.position - counts) <= window:
            self._astray_ns = 0
            return torque, status
        self._astray_ns += self._tick_ns
        if self._astray_ns > values[self._window_ms] * 1_000_000:
            self.fault = ErrorCode.FOLLOWING_ERROR
        return torque, status | FOLLOWING_ERROR

    def _follow_torque(self, velocity: float, offset: float) -> tuple[float, int]:
        values = self._values
        torque = values[self._target_torque] * self._nm + offset
        if abs(velocity) > values[self._max_speed] and torque * velocity > 0.0:
            return 0.0, FOLLOWING | INTERNAL_LIMIT
        return torque, FOLLOWING

    def _follow_velocity(self, counts: int, velocity: float, offset: float) -> tuple[float, int]:
        values = self._values
        target, top = values[self._target_velocity] + values[self._velocity_offset], values[self._max_speed]
        status = FOLLOWING
        if abs(target) > top:
            target, status = (top if target > 0 else -top), FOLLOWING | INTERNAL_LIMIT
        return self.servo.follow_velocity(target, offset, counts, velocity), status

    def _take_gains(self) -> None:
        store = self._store
        self.servo.set_gains(store.values[store.slot(0x2100, 1)], store.values[store.slot(0x2100, 2)])

    def _take_period(self) -> None:
        store = self._store
        value, exponent = store.values[store.slot(0x60C2, 1)], store.values[store.slot(0x60C2, 2)]
        self.servo.set_period(min(value * 10.0**exponent, 1.0))

    def _following_error(self) -> int:
        return round(self.servo.position) - self._values[self._position]
