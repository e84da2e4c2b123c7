"""Friction of a joint: LuGre bristles whose level depends on direction, speed, load, warmth, time and place.

    F   = σ0·z + σ1·ż + b(dq)·|dq|^n·sign(dq) + d·|dq|·dq
    ż   = dq − σ0·|dq|/g·z
    g   = m(q, t, T, load)·[c± + (s± − c±)·exp(−|dq/v_s|^δ)] + μ·|transmitted torque|

(Canudas de Wit, Olsson, Åström, Lischinsky 1995). m holds running-in, warmth and rough places. F is the torque that
the motor spends. Stuck, it is a spring of stiffness σ0; sliding steadily, ż = 0, and F is g and the viscous friction
against the motion. n is one of oil, and less of grease, which thins as it is sheared (Ostwald, de Waele).
"""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import Field, model_validator

from config.schema import Name, Positive, Section
from virtual_hw.hidden.quantities import NotNegative

BRISTLE_RELAXATION_S = 2e-3
CREEPING_RAD_S = 1e-3
"""Below, a power of the speed goes on straight to nothing."""


class RoughPlace(Section):
    """The level grows by ``increase`` (1 = doubled) about ``centre_rad``, as a bell of width ``width_rad``."""

    centre_rad: float
    width_rad: Positive
    increase: Annotated[float, Field(gt=-1)]


class RunningIn(Section):
    """The level's factor goes from ``initial_factor`` to 1 with the time constant."""

    initial_factor: NotNegative
    time_constant_s: Positive


class Friction(Section):
    """Friction of one joint, on the motor's side of an elastic transmission."""

    joint: Name
    level_nm: NotNegative
    """Coulomb level c for dq > 0, and for dq < 0 unless ``level_negative_nm`` says otherwise."""
    level_negative_nm: NotNegative | None = None
    breakaway_factor: Annotated[float, Field(ge=1)] = 1.0
    """s/c: breakaway level over Coulomb level."""
    stribeck_velocity_rad_s: Positive = 0.05
    stribeck_exponent: Annotated[float, Field(ge=0.5, le=2)] = 2.0
    viscous_nms_rad: NotNegative = 0.0
    viscous_negative_nms_rad: NotNegative | None = None
    viscous_exponent: Annotated[float, Field(gt=0, le=1)] = 1.0
    """n: viscous friction is ``viscous_nms_rad`` N·m at 1 rad/s, and goes with this power of the speed."""
    drag_nms2_rad2: NotNegative = 0.0
    """Drag of the air or the churned grease, d·|dq|·dq."""
    presliding_rad: Positive = 2e-4
    """Deflection of the bristles at the Coulomb level: σ0 = level / presliding."""
    bristle_damping_nms_rad: NotNegative | None = None
    """σ1; σ0 · 2 ms when absent."""
    load_coefficient: NotNegative = 0.0
    """μ, N·m of friction for a N·m transmitted."""
    level_per_kelvin: float = 0.0
    """Relative change of the level for a kelvin of the motor above ambient."""
    viscous_per_kelvin: float = 0.0
    running_in: RunningIn | None = None
    rough_place: tuple[RoughPlace, ...] = ()

    @model_validator(mode="after")
    def _some_level(self) -> Self:
        if self.level_nm == 0 and self.load_coefficient == 0 and self.level_negative_nm:
            raise ValueError(
                "level_nm is 0 while level_negative_nm is not: the bristles need a level; give a small one"
            )
        return self


class BristleFriction:
    """The law at run time, discretised backward in time so that stiff bristles never limit the step.

    For a step h to the unknown speed dq⁺: z⁺ = α·(z + h·dq⁺), α = 1/(1 + h·σ0·|dq°|/g), dq° a forecast of dq⁺,
    hence F = explicit + implicit·dq⁺, which the integrator solves together with the inertia.
    """

    __slots__ = (
        "_alpha",
        "_bristle_damping",
        "_decay",
        "_drag",
        "_exponent",
        "_level_per_kelvin",
        "_load",
        "_minus",
        "_modulated",
        "_places",
        "_plus",
        "_run_in",
        "_stiffness",
        "_stribeck",
        "_stribeck_velocity",
        "_viscous_falls",
        "_viscous_minus",
        "_viscous_per_kelvin",
        "_viscous_plus",
        "explicit",
        "implicit",
        "z",
    )

    def __init__(self, law: Friction) -> None:
        self._plus = law.level_nm
        self._minus = law.level_nm if law.level_negative_nm is None else law.level_negative_nm
        self._stribeck = law.breakaway_factor - 1.0
        self._stribeck_velocity = law.stribeck_velocity_rad_s
        self._exponent = law.stribeck_exponent
        self._viscous_plus = law.viscous_nms_rad
        self._viscous_minus = (
            law.viscous_nms_rad if law.viscous_negative_nms_rad is None else law.viscous_negative_nms_rad
        )
        self._viscous_falls = law.viscous_exponent - 1.0
        self._drag = law.drag_nms2_rad2
        # Load-dependent friction alone still needs bristles: stiff ones for a level of 1 N·m.
        bristles = law.level_nm if law.level_nm > 0 or law.load_coefficient == 0 else 1.0
        self._stiffness = bristles / law.presliding_rad
        self._bristle_damping = (
            BRISTLE_RELAXATION_S * self._stiffness
            if law.bristle_damping_nms_rad is None
            else law.bristle_damping_nms_rad
        )
        self._load = law.load_coefficient
        self._level_per_kelvin = law.level_per_kelvin
        self._viscous_per_kelvin = law.viscous_per_kelvin
        self._run_in = (
            (law.running_in.initial_factor - 1.0, law.running_in.time_constant_s) if law.running_in else (0.0, 1.0)
        )
        self._decay = law.running_in is not None
        self._places = tuple((p.centre_rad, p.width_rad, p.increase) for p in law.rough_place)
        self._modulated = bool(self._decay or self._places or law.level_per_kelvin or law.viscous_per_kelvin)
        self._alpha = 1.0
        self.z = 0.0
        """Deflection of the bristles, rad."""
        self.explicit = 0.0
        self.implicit = 0.0

    def _modulation(self, q: float, kelvin: float, t: float) -> float:
        factor = 1.0 + self._level_per_kelvin * kelvin
        if self._decay:
            less, time_constant = self._run_in
            factor *= 1.0 + less * math.exp(-t / time_constant)
        for centre, width, increase in self._places:
            u = (q - centre) / width
            if -6.0 < u < 6.0:
                factor *= 1.0 + increase * math.exp(-0.5 * u * u)
        return factor if factor > 0.0 else 0.0

    def linearise(
        self, q: float, dq: float, forecast: float, transmitted: float, kelvin: float, t: float, h: float
    ) -> None:
        """Set ``explicit`` and ``implicit`` for the step of ``h`` seconds that begins with speed ``dq`` and is expected
        to end with ``forecast``.
        """
        if forecast > 0.0:
            speed, level, viscous = forecast, self._plus, self._viscous_plus
        else:
            speed, level, viscous = -forecast, self._minus, self._viscous_minus
        if self._stribeck:
            level *= 1.0 + self._stribeck * math.exp(-((speed / self._stribeck_velocity) ** self._exponent))
        if self._modulated:
            level *= self._modulation(q, kelvin, t)
            viscous *= max(0.0, 1.0 + self._viscous_per_kelvin * kelvin)
        if self._load:
            level += self._load * (transmitted if transmitted > 0.0 else -transmitted)
        if self._viscous_falls:
            viscous *= max(speed, CREEPING_RAD_S) ** self._viscous_falls
        # Viscous friction and drag act at the mean of the step's two speeds.
        smooth = 0.5 * (viscous + self._drag * speed)
        if level > 0.0 and self._stiffness > 0.0:
            stiffness, damping = self._stiffness, self._bristle_damping
            alpha = level / (level + h * stiffness * speed)
            z = self.z
            self._alpha = alpha
            self.explicit = alpha * stiffness * z + damping * (alpha - 1.0) * z / h + smooth * dq
            self.implicit = alpha * (stiffness * h + damping) + smooth
        else:
            self._alpha = 0.0
            self.explicit = smooth * dq
            self.implicit = smooth

    def settle(self, dq: float, h: float) -> float:
        """The step ended with speed ``dq``: move the bristles; returns the torque spent during the step."""
        self.z = self._alpha * (self.z + h * dq)
        return self.explicit + self.implicit * dq

    def hold(self, torque: float) -> None:
        """Start at rest carrying ``torque`` (N·m), as far as the bristles can."""
        if self._stiffness > 0.0:
            level = self._minus if torque < 0.0 else self._plus
            limit = level * (1.0 + self._stribeck)
            self.z = max(-limit, min(limit, torque)) / self._stiffness
