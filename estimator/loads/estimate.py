"""What the identification of a load found: the load, the sensor's offsets, what is left, and how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from estimator.delays import Delay
from estimator.loads.entries import entry, load_entries, load_warnings
from estimator.loads.fit import LoadFit
from estimator.loads.layout import LoadLayout
from estimator.loads.parameters import Measured, RigidLoad
from estimator.loads.rigidity import Rigidity
from estimator.loads.rows import Form

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LoadEstimate:
    """Result of `identify_load`; parameters in the sensor's frame, SI units."""

    load: RigidLoad
    """Without the hand, where one was given."""
    fit: LoadFit
    layout: LoadLayout
    band: float
    """Hz of the low-pass that regressor and wrench went through."""
    samples: int
    rows: int
    form: Form
    delay: Delay
    """Of the sensor against the angles; the wrench was taken back by it."""
    rigid: Rigidity
    warnings: tuple[str, ...]

    @property
    def offset(self) -> Measured:
        """(6,) N, N·m at session time zero; NaN for channels that were not fitted. With one in each recording: the
        first's."""
        return self._sensor("offset 0" if self.layout.offset_of_each else "offset")

    @property
    def drift(self) -> Measured:
        """(6,) N/s, N·m/s."""
        return self._sensor("drift")

    @property
    def wrench_residual(self) -> dict[str, dict[str, float]]:
        """Of each fitted channel: ``rms`` N or N·m in the band, ``relative`` to the measured wrench."""
        rms, power = np.sqrt(self.fit.autocovariance[:, 0]), np.sqrt(self.fit.power)
        return {
            name: {"rms": float(r), "relative": float(r / p) if p > 0.0 else 0.0}
            for name, r, p in zip(self.layout.names, rms, power, strict=True)
        }

    def interval(self, measured: Measured, level: float = 0.95) -> Array:
        """(…, 2) confidence interval of one of the load's quantities."""
        reach = measured.standard_error * student.isf((1.0 - level) / 2.0, self.fit.degrees_of_freedom)
        return np.stack([measured.value - reach, measured.value + reach], axis=-1)

    @cached_property
    def all_warnings(self) -> tuple[str, ...]:
        """Those of the recordings, and what of the load cannot be told."""
        return (*self.warnings, *load_warnings(self.load), *_rigid_warning(self.rigid))

    @property
    def status(self) -> str:
        """``identified``, or what stands against it."""
        if not np.isfinite(self.load.parameters).all():
            return "too little motion"
        return "not rigid" if self.rigid.verdict == "not rigid" else "identified"

    def as_json(self) -> dict[str, Any]:
        """The answer of ``identify load``; what the data do not tell is null. Intervals of a load that is not rigid
        mean nothing: its standard errors are withheld."""
        held = self.rigid.verdict == "not rigid"
        return {
            **load_entries(self.load, held),
            "wrench_residual": self.wrench_residual,
            "rigid": {
                "verdict": self.rigid.verdict,
                "p_value": self.rigid.p_value,
                "noise_from": self.rigid.noise_from,
                "detectable_share": self.rigid.detectable,
            },
            "offset": entry(self.offset, "N, N·m", held),
            "drift": entry(self.drift, "N/s, N·m/s", held),
            "wrench_delay": {
                "value": self.delay.value,
                "standard_error": None if held else self.delay.standard_error,
                "unit": "s",
            },
            "samples": self.samples,
            "rows": self.rows,
            "band_hz": self.band,
            "form": self.form,
            "status": self.status,
            "warnings": list(self.all_warnings),
        }

    def _sensor(self, kind: str) -> Measured:
        value, covariance = np.full(6, np.nan), np.diag(np.full(6, np.inf))
        if kind in self.layout.kinds:
            place, channels = self.layout.place(kind), list(self.layout.channels)
            value[channels] = self.fit.value[place]
            covariance[np.ix_(channels, channels)] = self.fit.covariance[place, place]
        return Measured(value, covariance)


def _rigid_warning(rigid: Rigidity) -> list[str]:
    if rigid.verdict == "not rigid":
        return [f"no rigid body explains the wrench (p = {rigid.p_value:.1g}): standard errors are withheld"]
    return [f"rigidity is untested: {rigid.reason}"] if rigid.verdict == "untested" else []
