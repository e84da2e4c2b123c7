"""What motors give their torque for beside the given model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.observed.stretches import Stretch
from estimator.effects import Law, Place, Signals

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spent:
    """A cause, as it was fitted."""

    law: Law
    place: Place
    theta: Array
    coefficients: Array

    def torque(self, signals: Signals) -> Array:
        """(samples, n) N·m along a motion."""
        result = np.zeros_like(signals.q)
        rows = list(self.law.rows(signals.body, self.place))
        result[:, rows] = self.law.columns(self.place, signals, self.theta) @ self.coefficients
        return result


def along(signals: Signals, spent: Sequence[Spent]) -> Signals:
    """The same motion with the torque that motors give for all ``spent``."""
    if not spent and signals.tau_beside is None:
        return signals
    beside = sum((one.torque(signals) for one in spent), start=np.zeros_like(signals.q))
    other = replace(signals, tau_beside=beside)
    # What was worked out of the motion stays.
    other.__dict__.update(signals.__dict__ | {"tau_beside": beside})
    return other


def spending(pieces: Sequence[Stretch], spent: Sequence[Spent]) -> list[Stretch]:
    """The same stretches with the torque that motors give for all ``spent``; what is left of the measured torques
    stays."""
    return [replace(piece, signals=along(piece.signals, spent)) for piece in pieces]
