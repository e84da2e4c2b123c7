"""What identifying links gives: values with errors, what the data cannot tell, and how well the torques fit."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from estimator.base_parameters import BaseParameters
from estimator.rigid_body import RigidBody
from estimator.terms import PARAMETER_OF, Term, unit_of

Array = NDArray[np.float64]


_LEVEL = 0.95
LEAST_MASS_KG = 1e-9
"""Below it a mass is the rounding of zero."""
_LACKS = 0.01
"""False alarms of the lack-of-fit test, over all joints together."""


@dataclass(frozen=True)
class TorqueResidual:
    """Of one joint, in the band of the estimate: rms of the residual (``unit``), relative to the torque's own rms, and
    the rms that measurement noise alone would leave (white noise assumed, as strong as above the band)."""

    rms: float
    relative: float
    noise_rms: float
    unit: str
    """N·m, or N where the joint slides."""
    in_motion: float
    """Share of the rows that counts: friction at rest is no function of velocity (`estimator.standstill`)."""


@dataclass(frozen=True)
class Fit:
    """Torque residuals over some recordings; `relative_error`: 100·‖residual‖/‖measured‖ over all joints, percent."""

    joints: dict[str, TorqueResidual]
    relative_error: float
    samples: int
    rows: int


@dataclass(frozen=True)
class LackOfFit:
    """Of one joint, from repeated motion: does the model leave more than noise? See `estimator.lack_of_fit`."""

    ratio: float
    """Mean square of what all playings share over that of what differs, one without lack of fit."""
    p_value: float
    lacking_rms: float
    """N·m, in the band of the estimate: what the model lacks."""
    noise_rms: float
    """N·m, in the band of the estimate: pure error, without any model."""
    playings: int


@dataclass(frozen=True)
class LinkIdentification:
    """Identified links. Unknowns are the base parameters, then the terms."""

    body: RigidBody
    base: BaseParameters
    terms: tuple[Term, ...]
    value: Array
    """(rank + terms,)"""
    covariance: Array
    """Of `value`; NaN rows for base parameters that the motion did not excite."""
    degrees_of_freedom: Array
    """Of each standard error, for Student's intervals: few where few parts of the recordings tell a value."""
    estimator: str
    band: float
    """Hz: half-power edge of the low-pass that regressor and torque share."""
    samples: int
    duration: float
    """s"""
    condition_number: float
    """Of the filtered base regressor, all joints alike, columns in SI units."""
    fit: Fit
    hold_out: Fit | None
    status: str
    """``identified``, ``too little motion`` or ``too little data``."""
    warnings: tuple[str, ...] = ()
    tests: dict[str, dict[str, float | str]] = field(default_factory=dict)
    lack_of_fit: tuple[LackOfFit, ...] | None = None
    """One a joint; None where no motion was repeated."""
    leave_one_out: dict[str, float] = field(default_factory=dict)
    """For each recording its relative torque error, percent, as predicted from the others."""

    @property
    def beta(self) -> Array:
        """(rank,) base parameters."""
        return self.value[: self.base.rank]

    @property
    def standard_error(self) -> Array:
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @property
    def withheld(self) -> str | None:
        """Why there are no confidence intervals, or None where there are.

        Standard errors say how the answer would scatter if everything were done again. Where the model lacks more than
        noise the answer scatters around something else than the truth, and no interval about it can be promised.
        """
        if not self.degrees_of_freedom.any():
            return "too short for standard errors"
        if self.lack_of_fit is None:
            return None
        level = _LACKS / len(self.lack_of_fit)
        named = [
            f"{joint} ({test.lacking_rms:.2g} N·m beside {test.noise_rms:.2g} N·m of noise)"
            for joint, test in zip(self.body.joints, self.lack_of_fit, strict=True)
            if test.p_value < level
        ]
        return f"repeated motion shows that the model lacks something at {', '.join(named)}" if named else None

    def interval(self, level: float = 0.95) -> Array:
        """(P, 2) confidence intervals of base parameters and terms; NaN where they are `withheld`."""
        if self.withheld is not None:
            return np.full((len(self.value), 2), np.nan)
        half = student.ppf(0.5 + level / 2.0, np.maximum(self.degrees_of_freedom, 1.0)) * self.standard_error
        return np.column_stack([self.value - half, self.value + half])

    def full_parameters(self, prior: Array | None = None) -> Array:
        """(10·n,) inertial parameters with the identified base parameters that are nearest ``prior`` (zero: as ridge
        regression with vanishing d would have them, Eq. 4.9). No promise of physical consistency."""
        start = np.zeros(self.base.combination.shape[1]) if prior is None else np.asarray(prior, dtype=float)
        correction = np.linalg.pinv(self.base.combination) @ (self.beta - self.base.combination @ start)
        return np.asarray(start + correction)

    def identified_body(self, prior: Array | None = None) -> RigidBody:
        """The arm with `full_parameters`. A link with moments whose mass no torque tells, and ``prior`` does not know,
        weighs a kilogram: a body without mass has no centre to keep them by, and any mass has the same torques."""
        start = np.zeros(self.base.combination.shape[1]) if prior is None else np.array(prior, dtype=float)
        links = self.full_parameters(start).reshape(-1, 10)
        bare = (np.abs(links[:, 0]) < LEAST_MASS_KG) & links[:, 1:4].any(axis=1)
        start[::10][bare] = 1.0
        return self.body.with_parameters(self.full_parameters(start))

    def as_json(self) -> dict[str, Any]:
        """Plain data, SI units; NaN becomes None."""
        errors = self.standard_error
        rank = self.base.rank
        return {
            "samples": self.samples,
            "duration": self.duration,
            "estimator": self.estimator,
            "band": self.band,
            "joints": list(self.body.joints),
            "held": dict(self.body.held),
            "base_parameters": [
                {"name": name, "value": float(value), "standard_error": _plain(error), "unit": unit}
                for name, value, error, unit in zip(
                    self.base.names, self.beta, errors[:rank], self.base.units, strict=True
                )
            ],
            "effects": [
                {
                    "effect": term.name,
                    "joint": self.body.joints[term.joint],
                    "parameter": PARAMETER_OF[term.name][0],
                    "value": float(value),
                    "standard_error": _plain(error),
                    "unit": unit_of(term.name, self.body.axes[term.joint].revolute),
                    **({"width": term.width} if term.name == "coulomb_friction" else {}),
                }
                for term, value, error in zip(self.terms, self.value[rank:], errors[rank:], strict=True)
            ],
            "identifiability": {
                "alone": list(self.base.alone),
                "combined": list(self.base.combined),
                "not": list(self.base.absent),
            },
            "torque_residual": _residuals(self.fit),
            "relative_error": self.fit.relative_error,
            "hold_out": None if self.hold_out is None else _residuals(self.hold_out),
            "hold_out_relative_error": None if self.hold_out is None else self.hold_out.relative_error,
            "condition_number": _plain(self.condition_number),
            "status": self.status,
            "warnings": list(self.warnings),
            "tests": self.tests,
            "intervals": self._intervals(),
            "lack_of_fit": self._lack_of_fit(),
            "leave_one_out": dict(self.leave_one_out),
        }

    def _intervals(self) -> dict[str, Any]:
        if self.withheld is not None:
            return {"withheld": self.withheld}
        half = np.diff(self.interval(_LEVEL), axis=1)[: self.base.rank, 0] / 2.0
        by_name = {
            name: None if math.isnan(h) else [float(value - h), float(value + h)]
            for name, value, h in zip(self.base.names, self.beta, half, strict=True)
        }
        caution = None if self.lack_of_fit else "no motion was repeated: that the model lacks nothing is not tested"
        return {"level": _LEVEL, "base_parameters": by_name, "caution": caution}

    def _lack_of_fit(self) -> dict[str, dict[str, float]] | None:
        if self.lack_of_fit is None:
            return None
        return {
            joint: {
                "ratio": test.ratio,
                "p_value": test.p_value,
                "lacking_rms": test.lacking_rms,
                "noise_rms": test.noise_rms,
                "playings": test.playings,
            }
            for joint, test in zip(self.body.joints, self.lack_of_fit, strict=True)
        }


def _residuals(fit: Fit) -> dict[str, dict[str, float | str]]:
    return {joint: asdict(residual) for joint, residual in fit.joints.items()}


def _plain(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None
