"""What a joint's friction does while the joint turns round, which no law tells to the last.

The shape in which bristles bend, the sample in which the sign changes, the count below which an encoder sees nothing:
where dry friction is large beside the noise, a torque is less sure where its joint turns, by an error of its own in
each sample. How large it is and how far it reaches is what makes the residual of a first look at the frictions most
likely.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs

Array = NDArray[np.float64]
Filter = Callable[[Array], Array]
"""(columns, samples) to (columns, rows), of which each comes of as many samples as the next."""

WAYS = (3e-5, 1e-4, 1e-3)
"""Of a joint's range, over which a reversal fades."""
SHARES = (0.05, 0.1, 0.2, 0.5, 1.0)
"""Of the dry friction, the error of a sample in which a joint turns."""
_WORTH = 40.0
"""nats by which errors of reversals must make a residual more likely: with fewer they may be a law's that acts there
too, as a rise from rest does, and would hide it."""
_BLOCKS = 32
"""Rows either side of a sample within which its error is spread."""
_MOST = 1e10
"""Of the noise's variance: beside more, it would be lost in rounding."""
_STANDS = 0.01
"""Of its fastest: slower a joint is as good as standing, held by bristles that have not let go."""
REST = 2
"""Rows for which a joint stands at least that is held; less is its turning round."""
_TRAVEL = 1e-3
"""rad, m: with less from end to end a joint stands throughout, however its servo trembles."""
_NOTHING = 1e-6
"""Of the largest response: rows that a sample's error does not reach."""


@dataclass(frozen=True)
class Turning:
    """Of one channel."""

    joint: int
    error: float
    """N·m, standard deviation of each sample's where the joint turns."""
    way: float
    """rad from there over which it falls to 1/e."""
    held: float = 0.0
    """N·m, standard deviation of what a standing joint is held by, the same for as long as it stands."""

    def variance(self, q: Array, dq: Array, least: int) -> Array:
        """(samples,) of angles and speeds (samples, n); ``least`` as `standing` takes it."""
        angle, speed = q[:, self.joint], dq[:, self.joint]
        turns, stands = near_turns(angle, self.way), standing(angle, speed, least)
        return np.asarray(np.square(self.error * turns) + self.held**2 * stands)


def near_turns(q: Array, way: float) -> Array:
    """(samples,) one where angles (samples,) turn, and falling with the ``way`` from there; zero where they never
    do."""
    step = np.sign(np.diff(q))
    moving = np.flatnonzero(step)
    turns = moving[1:][step[moving[1:]] != step[moving[:-1]]]
    if not len(turns):
        return np.zeros(len(q))
    # The next turn, and the one before it.
    following = np.searchsorted(turns, np.arange(len(q)))
    places = q[turns]
    after = np.abs(q - places[np.minimum(following, len(turns) - 1)])
    before = np.abs(q - places[np.maximum(following - 1, 0)])
    return np.asarray(np.exp(-np.minimum(before, after) / way))


def standing(q: Array, dq: Array, least: int) -> Array:
    """(samples,) how many samples a joint with angles and speeds (samples,) as good as stands still for, at each of
    them; zero where it moves, or stands for less than ``least`` samples, as where it turns round.

    So many errors of single samples have a mean as unsure as one of them divided by the root of their number: times
    this, their variance is that of an error which they all share.
    """
    stands = (np.abs(dq) <= _STANDS * np.abs(dq).max(initial=0.0)) | stands_throughout(q)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], stands.astype(int), [0]])))
    result = np.zeros(len(q))
    for begin, end in edges.reshape(-1, 2):
        if end - begin >= least:
            result[begin:end] = end - begin
    return result


def stands_throughout(q: Array) -> bool:
    """Whether a joint with these angles (samples,) moves nowhere."""
    return bool(np.ptp(q) <= _TRAVEL) if len(q) else True


class Spread:
    """How the errors of single samples come out in a channel's rows."""

    def __init__(self, rows_of: Filter, decimation: int) -> None:
        impulses = np.zeros((decimation, 2 * _BLOCKS * decimation))
        impulses[np.arange(decimation), _BLOCKS * decimation + np.arange(decimation)] = 1.0
        response = rows_of(impulses)
        size = np.abs(response).max(axis=0)
        reached = np.flatnonzero(size > _NOTHING * size.max())
        self._first = int(reached[0]) - _BLOCKS
        self._response = response[:, reached[0] : reached[-1] + 1]
        self._decimation = decimation

    def covariance(self, variance: Array, rows: int) -> Array:
        """(lags, rows) of each row with those after it, of errors with this variance (samples,)."""
        blocks = -(-len(variance) // self._decimation)
        padded = np.zeros((blocks, self._decimation))
        padded.ravel()[: len(variance)] = variance
        width = self._response.shape[1]
        result = np.zeros((min(width, rows), rows))
        lead = np.zeros(max(self._first, 0))
        for lag, own in enumerate(result):
            products = self._response[:, : width - lag] * self._response[:, lag:]
            whole = np.sum([np.convolve(v, p) for v, p in zip(padded.T, products, strict=True)], axis=0)
            whole = np.append(lead, whole)[max(-self._first, 0) :][:rows]
            own[: len(whole)] = whole
        return result


def factor(covariance: Array) -> Array:
    """Of the rows' own noise, which is white, and an error with this ``covariance`` (lags, rows) beside it."""
    whole = covariance.copy()
    whole[0] += 1.0
    return np.asarray(cholesky_banded(whole, lower=True))


def settled(factored: Array | None, rows: Array) -> Array:
    """(columns, rows) made white of those whose noise has this `factor`; as they are without one."""
    if factored is None:
        return rows
    result, _ = dtbtrs(factored, rows.T, uplo="L")
    return np.asarray(result.T)


def most_likely(
    residuals: Sequence[Array], angles: Sequence[Array], spreads: Sequence[Spread], friction: float, span: float
) -> tuple[float, float]:
    """The error and the way (`Turning`) that make a channel's ``residuals``, (rows,) of each stretch, most likely, of
    a noise that is otherwise white; zero where there is hardly any.

    ``angles`` (samples,) of its joint in each stretch, ``spreads`` likewise, ``friction`` N·m, ``span`` rad of the
    joint's motion.
    """
    count = sum(map(len, residuals))
    power = sum(float(r @ r) for r in residuals)
    best, found = _WORTH - 0.5 * count * np.log(power / count), (0.0, span)
    for way in np.array(WAYS) * span:
        units = [
            spread.covariance(near_turns(q, way) ** 2, len(r))
            for spread, q, r in zip(spreads, angles, residuals, strict=True)
        ]
        loudest = max(float(unit[0].max()) for unit in units)
        for error in (share * friction for share in SHARES):
            if error**2 * loudest > _MOST:
                break
            factors = [factor(error**2 * unit) for unit in units]
            power = sum(float(np.sum(settled(f, r[None]) ** 2)) for f, r in zip(factors, residuals, strict=True))
            narrowed = sum(float(np.sum(np.log(f[0]))) for f in factors)
            # The rest of the noise is as large as it comes out: what is far from all turns is nothing of theirs.
            nats = -0.5 * count * np.log(power / count) - narrowed
            if nats > best:
                best, found = nats, (error * float(np.sqrt(power / count)), float(way))
    return found
