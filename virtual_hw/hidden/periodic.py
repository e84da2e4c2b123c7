"""Torques that come back with every turn: cogging, ripple of the motor, the beat of two joints' gears."""

from __future__ import annotations

import math
from collections.abc import Iterable

from config.schema import Name, Positive, Section
from virtual_hw.hidden.quantities import NotNegative


class Cogging(Section):
    """τ = a·sin(k·q + φ), spent whatever the torque."""

    joint: Name
    order: Positive
    """k, periods a joint turn."""
    amplitude_nm: NotNegative
    phase_rad: float = 0.0


class TorqueRipple(Section):
    """True torque = τ·(1 − a·sin(k·q + φ)): the motor spends τ·a·sin(k·q + φ)."""

    joint: Name
    order: Positive
    amplitude: NotNegative
    """Share of the torque."""
    phase_rad: float = 0.0


class Harmonics:
    """Σ a·sin(k·q + φ)."""

    __slots__ = ("_terms",)

    def __init__(self, terms: Iterable[tuple[float, float, float]]) -> None:
        self._terms = tuple(terms)

    def __bool__(self) -> bool:
        return bool(self._terms)

    def at(self, q: float) -> float:
        total = 0.0
        for order, amplitude, phase in self._terms:
            total += amplitude * math.sin(order * q + phase)
        return total

    def torque(self, q: float, dq: float, h: float) -> float:
        return self.at(q)


class GearMesh(Section):
    """Two joints whose gears share a shaft: both spend a·sin(k·q + k_other·q_other + φ), the other ``ratio`` of it."""

    joint: Name
    joint_other: Name
    order: float
    order_other: float
    amplitude_nm: NotNegative
    phase_rad: float = 0.0
    ratio: float = 1.0
