"""Between the drives' servos and the arm: demands go to the motors one tick late, senses are latched at each tick.

A servo computes its demand from the senses of a tick and the current loop takes it up at the next one, as in drives
that double-buffer their set-points. So the arm can be moved on by up to two ticks beyond the last servo tick before
anything more is heard from the host.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Protocol

from config.schema import Joint


class Arm(Protocol):
    """The mechanics, as `virtual_hw.plant` builds them. Torques and speeds in the joints' positive direction."""

    n: int
    tick_ns: int
    time_ns: int

    def advance(self, torque_nm: Sequence[float], brake: Sequence[bool]) -> None: ...
    def counts(self, i: int) -> int: ...
    def velocity(self, i: int) -> float: ...
    def torque(self, i: int) -> float: ...
    def currents(self, i: int) -> tuple[float, float, float]: ...
    def temperature(self, i: int) -> float: ...


class SerialSensor(Protocol):
    """A sensor on a serial line, as `virtual_hw.wrench` builds them; times on the arm's clock."""

    @property
    def total_bytes(self) -> int: ...
    def advance(self, now_ns: int) -> None: ...
    def fileno(self) -> int: ...
    def close(self) -> None: ...


class Senses:
    """What all drives sense at one tick: counts, counts/s in the drives' direction, N·m at the joints."""

    __slots__ = ("counts", "serial_bytes", "speed", "torque")

    def __init__(self, counts: list[int], speed: list[float], torque: list[float], serial_bytes: list[int]) -> None:
        self.counts, self.speed, self.torque = counts, speed, torque
        self.serial_bytes = serial_bytes
        """Bytes each sensor's line has carried altogether by this tick."""


class PowerStage:
    """The arm with its serial sensors, one tick at a time."""

    def __init__(self, arm: Arm, joints: Sequence[Joint]) -> None:
        self._arm = arm
        self._sensors: Sequence[SerialSensor] = ()
        self._sign = [joint.encoder.sign for joint in joints]
        self._counts_per_rad = [
            joint.encoder.sign * joint.encoder.counts_per_turn / (2.0 * math.pi) for joint in joints
        ]
        self._indices = range(arm.n)
        self._demands: deque[tuple[list[float], list[bool]]] = deque([([0.0] * arm.n, [True] * arm.n)])
        self._latched: deque[Senses] = deque([self._latch()])
        self.senses = self._latched[0]
        """Of the last servo tick."""

    def connect(self, sensors: Sequence[SerialSensor]) -> None:
        """Move these sensors on with the arm; before time moves."""
        self._sensors = sensors
        for senses in self._latched:
            senses.serial_bytes = self.carried_now()

    def at_tick(self) -> Senses:
        """What is sensed at the servo tick that is due now; `demand` must follow."""
        if not self._latched:
            self.run_ahead(1)
        self.senses = self._latched.popleft()
        return self.senses

    def demand(self, torque_nm: list[float], brake: list[bool]) -> None:
        """The servos' answer to `at_tick`: N·m at the joints in the drives' direction."""
        signed = [sign * torque for sign, torque in zip(self._sign, torque_nm, strict=True)]
        self._demands.append((signed, brake))

    def run_ahead(self, ticks: int = 2) -> None:
        """Move the arm on through at most ``ticks`` of the ticks whose demands are known."""
        for _ in range(min(ticks, len(self._demands))):
            self._arm.advance(*self._demands.popleft())
            for sensor in self._sensors:
                sensor.advance(self._arm.time_ns)
            self._latched.append(self._latch())

    def carried_now(self) -> list[int]:
        """Bytes each sensor's line has carried altogether, beyond the last tick too."""
        return [sensor.total_bytes for sensor in self._sensors]

    def serve_sensors(self) -> None:
        """Let the sensors see to what the host has written to them."""
        for sensor in self._sensors:
            sensor.advance(self._arm.time_ns)

    def currents_a(self, i: int) -> tuple[float, float, float]:
        return self._arm.currents(i)

    def temperature_c(self, i: int) -> float:
        return self._arm.temperature(i)

    def _latch(self) -> Senses:
        arm, indices = self._arm, self._indices
        return Senses(
            [_wrapped(arm.counts(i)) for i in indices],
            [factor * arm.velocity(i) for i, factor in zip(indices, self._counts_per_rad, strict=True)],
            [arm.torque(i) for i in indices],
            self.carried_now(),
        )


def _wrapped(counts: int) -> int:
    """As a 32-bit position register holds it."""
    return counts if -0x8000_0000 <= counts < 0x8000_0000 else (counts + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000
