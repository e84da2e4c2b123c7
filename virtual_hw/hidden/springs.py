"""Torques that depend on where a joint stands: springs, counterbalances, dress packs with hysteresis.

Every law gives the torque that the motor spends, on the link's side of an elastic transmission.
"""

from __future__ import annotations

import math
from typing import Annotated, Protocol, Self

from pydantic import Field, model_validator

from config.schema import Name, Positive, Section
from virtual_hw.hidden.quantities import Fraction, NotNegative


class JointLaw(Protocol):
    """A torque on one joint."""

    def torque(self, q: float, dq: float, h: float) -> float:
        """Torque spent, N·m, at angle ``q`` (rad) and speed ``dq`` (rad/s), for a step of ``h`` seconds."""
        ...


class JointSpring(Section):
    """A cable, hose or spring: τ = k·(q − q0) + k3·(q − q0)³."""

    joint: Name
    stiffness_nm_rad: NotNegative
    centre_rad: float = 0.0
    cubic_nm_rad3: NotNegative = 0.0

    def law(self) -> JointLaw:
        return _Spring(self)


class _Spring:
    __slots__ = ("_centre", "_cubic", "_stiffness")

    def __init__(self, law: JointSpring) -> None:
        self._stiffness, self._cubic, self._centre = law.stiffness_nm_rad, law.cubic_nm_rad3, law.centre_rad

    def torque(self, q: float, dq: float, h: float) -> float:
        x = q - self._centre
        return (self._stiffness + self._cubic * x * x) * x


class HydraulicCounterbalance(Section):
    """A gas-charged cylinder between a point at ``anchor_m`` from the axis and one at ``rod_m`` on the link.

    Length L(q) = sqrt(a² + b² − 2ab·cos(q − q0)), shortest at q0; the gas resists extension with
    F = p0·A·(V0/(V0 − A·(L − L0)))^κ, L0 = |a − b|, and the motor spends F·dL/dq = F·ab·sin(q − q0)/L.
    """

    joint: Name
    anchor_m: Positive
    rod_m: Positive
    aligned_rad: float
    """q0, where the two points are nearest."""
    preload_n: Positive
    """p0·A."""
    gas_travel_m: Positive
    """V0/A: the travel that would press the gas to nothing."""
    polytropic: Annotated[float, Field(ge=1, le=1.7)] = 1.3

    @model_validator(mode="after")
    def _geometry(self) -> Self:
        if self.anchor_m == self.rod_m:
            raise ValueError("anchor_m equals rod_m: the cylinder would have no length at aligned_rad")
        if self.gas_travel_m <= 2 * min(self.anchor_m, self.rod_m):
            raise ValueError("gas_travel_m is not longer than the cylinder's whole travel 2·min(anchor_m, rod_m)")
        return self

    def law(self) -> JointLaw:
        return _Counterbalance(self)


class _Counterbalance:
    __slots__ = ("_kappa", "_preload", "_product", "_q0", "_shortest", "_squares", "_travel")

    def __init__(self, law: HydraulicCounterbalance) -> None:
        a, b = law.anchor_m, law.rod_m
        self._squares, self._product, self._shortest = a * a + b * b, a * b, abs(a - b)
        self._q0, self._preload, self._travel, self._kappa = (
            law.aligned_rad,
            law.preload_n,
            law.gas_travel_m,
            law.polytropic,
        )

    def torque(self, q: float, dq: float, h: float) -> float:
        x = q - self._q0
        length = math.sqrt(self._squares - 2.0 * self._product * math.cos(x))
        pressed = self._travel / (self._travel - (length - self._shortest))
        return self._preload * math.exp(self._kappa * math.log(pressed)) * self._product * math.sin(x) / length


class CableHysteresis(Section):
    """A dress pack with memory (Bouc–Wen): τ = k·(ρ·(q − q0) + (1 − ρ)·z),
    ż = dq − (β·|dq|·|z|^(n−1)·z + (1 − β)·dq·|z|^n)/x^n, |z| ≤ x.
    """

    joint: Name
    stiffness_nm_rad: NotNegative
    centre_rad: float = 0.0
    elastic_share: Fraction = 0.3
    """ρ: share of the stiffness without memory."""
    yield_rad: Positive = 0.1
    """x: deflection at which the memory saturates."""
    sharpness: Annotated[float, Field(ge=1, le=10)] = 1.0
    """n."""
    dissipation: Annotated[float, Field(ge=0.5, le=1)] = 0.5
    """β: 0.5 makes unloading straight."""

    def law(self) -> JointLaw:
        return _BoucWen(self)


class _BoucWen:
    __slots__ = ("_beta", "_centre", "_n", "_share", "_stiffness", "_yield", "_z")

    def __init__(self, law: CableHysteresis) -> None:
        self._stiffness, self._centre, self._share = law.stiffness_nm_rad, law.centre_rad, law.elastic_share
        self._yield, self._n, self._beta = law.yield_rad, law.sharpness, law.dissipation
        self._z = 0.0

    def torque(self, q: float, dq: float, h: float) -> float:
        u = self._z / self._yield
        grown = abs(u) ** self._n
        towards = 1.0 if u * dq > 0.0 else -1.0
        self._z += h * dq * (1.0 - grown * (self._beta * towards + 1.0 - self._beta))
        return self._stiffness * (self._share * (q - self._centre) + (1.0 - self._share) * self._z)
