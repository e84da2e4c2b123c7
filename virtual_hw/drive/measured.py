"""Objects that a drive measures at the moment in which they are read: torque, temperature, phase currents."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from config.schema import Joint
from virtual_hw.drive.objects import ObjectStore


class MotorSenses(Protocol):
    """What a drive measures beside position and velocity, asked when it is read."""

    def torque_nm(self) -> float:
        """Torque by the motor's current, N·m at the joint."""

    def currents_a(self) -> tuple[float, float, float]:
        """Phase currents, A."""

    def temperature_c(self) -> float:
        """Winding temperature, °C."""


def connect_measured(store: ObjectStore, joint: Joint, senses: MotorSenses) -> None:
    """Connect the objects that are measured when they are read."""
    permille = joint.encoder.sign * 1000.0 / joint.rated_torque_nm
    sources: dict[tuple[int, int], Callable[[], int]] = {
        (0x6077, 0): lambda: _i16(senses.torque_nm() * permille),
        (0x2110, 0): lambda: _i16(senses.temperature_c() * 10.0),
    }
    for phase in range(3):
        sources[0x2111, phase + 1] = lambda phase=phase: round(senses.currents_a()[phase] * 1000.0)  # type: ignore[misc]
    for key, source in sources.items():
        if store.has(*key):
            store.sources[key] = source


def _i16(value: float) -> int:
    rounded = round(value)
    return rounded if -0x8000 <= rounded <= 0x7FFF else 0x7FFF if rounded > 0 else -0x8000
