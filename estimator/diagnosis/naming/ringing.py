"""The frequency at which a joint rings: what is left of a load that swings, or of a part that bends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import stretch_rows
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined

Array = NDArray[np.float64]

_WIDE = 1.2
"""Upper edge of the band about a line, over its middle; the lower is as far below."""
_MOST = 0.5
"""Of what is left beyond the noise, the share that a line holds …"""
_OWN = 2.0
"""… and times the share of the motion's accelerations that lie there: what follows the motion does not ring."""
_SURELY = 5.0
"""Standard errors by which a line must stand above white noise."""
_GRID = 60
"""Lines that are tried, evenly on a logarithmic scale."""


def ringing(evidence: Evidence, refined: Refined, channel: int) -> float | None:
    """Hz of the line that most of what is left on a torque channel lies about, beyond the noise; None where it lies at
    all frequencies, or where the motion does."""
    joint, left, moved = evidence.grid.channels[channel].index, [], []
    value = refined.value[refined.design.members[channel]]
    for piece, decimation in zip(evidence.pieces, evidence.decimations, strict=True):
        rows = stretch_rows(refined.design, piece, decimation, evidence.noise)[channel]
        left.append(_spectrum(rows[-1] - value @ rows[:-1], piece.signals.period * decimation))
        moved.append(_spectrum(piece.signals.ddq[:, joint], piece.signals.period))
    frequency, power = (np.concatenate(x) for x in zip(*left, strict=True))
    other, motion = (np.concatenate(x) for x in zip(*moved, strict=True))
    # White noise of unit variance has a unit of power in every bin.
    beyond = power - 1.0
    within = other <= evidence.grid.band
    whole, moving = float(beyond.sum()), float(motion[within].sum())
    if whole <= 0.0 or moving <= 0.0:
        return None
    lines = np.geomspace(frequency[frequency > 0.0].min() * _WIDE, evidence.grid.band / _WIDE, _GRID)
    shares = [float(beyond[_about(frequency, line)].sum()) / whole for line in lines]
    best = int(np.argmax(shares))
    near = _about(frequency, lines[best])
    if float(beyond[near].sum()) < _SURELY * np.sqrt(np.count_nonzero(near)):
        return None
    if shares[best] < max(_MOST, _OWN * float(motion[within & _about(other, lines[best])].sum()) / moving):
        return None
    return float(np.average(frequency[near], weights=power[near]))


def _about(frequency: Array, line: float) -> NDArray[np.bool_]:
    return np.asarray((frequency > line / _WIDE) & (frequency < line * _WIDE))


def _spectrum(x: Array, period: float) -> tuple[Array, Array]:
    """Frequencies, Hz, and the power of each bin, in the variance of ``x`` (samples,); without the constant."""
    window = np.hanning(len(x) + 2)[1:-1]
    power = np.abs(np.fft.rfft(x * window)) ** 2 / np.sum(window**2)
    return np.asarray(np.fft.rfftfreq(len(x), period)[1:]), np.asarray(power[1:])
