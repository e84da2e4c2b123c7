"""Ripple and cogging that practice has taught: the torque it added, told apart by the order of the rotor's angle.

What repeats with a rotor's angle holds for every motion of the joint, near or far, forward or back; a local model knows
it only along the one path, and at the torques, that were practised. So it is named first (Section 7.1), and goes into
the model. The identification's band ends far below where such torques lie in a fast motion; practice's does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import f as fisher

from estimator.arm_model import ArmModel, FittedEffect, fitted_effect
from estimator.effects import Effect, Place, Scales, Signals, effect
from learner.cosine_spectrum import frequencies, to_lines

Array = NDArray[np.float64]
PERIODIC = ("torque_ripple", "cogging")
SMOOTH_HZ = 6.0
"""Below it lie rigid bodies and friction too: nothing there is taken for a periodic torque."""
FALSE_ALARM = 1e-4
"""Probability that a joint gets a periodic torque that it has not, over all orders that are tried."""
LEAST_SHARE = 0.12
"""Of the power between `SMOOTH_HZ` and the band, what an order must explain: neighbouring lines of a residual that is
no noise are alike, and the F test would believe in each."""
MOST = 4
"""Orders a joint."""
IN_SIGHT = 0.35
"""Of an order's own power, what must lie between `SMOOTH_HZ` and the band: a slow one would be told by its edges."""
TOLD_APART = 0.5
"""Of a column's power, what the orders already chosen must leave: two that are nearly alike imitate anything."""
FEWEST_LINES = 20


@dataclass(frozen=True)
class _Candidate:
    effect: Effect
    place: Place
    theta: Array
    lines: Array
    """(lines, 2) of its two quadratures."""


def periodic_torques(
    model: ArmModel, q: Array, dq: Array, ddq: Array, correction: Array, period: float, band_hz: float
) -> tuple[FittedEffect, ...]:
    """The periodic torques in what practice added to ``model``'s torque.

    ``q, dq, ddq``: the practised motion without its rests, samples × n, every ``period`` s, at the instants at which
    torques act. ``correction``: N·m (samples, n), learnt up to ``band_hz``.
    """
    signals = Signals.of_motion(model.body, np.arange(len(q), dtype=float) * period, q, dq, ddq)
    lines = frequencies(len(q), period)
    seen = np.flatnonzero((lines > SMOOTH_HZ) & (lines <= band_hz))
    if len(seen) < FEWEST_LINES:
        return ()
    scales = Scales.of([signals], band_hz)
    found: list[FittedEffect] = []
    for joint in range(model.body.n):
        if np.ptp(q[:, joint]) > 0.0:
            found += _at_joint(joint, signals, scales, to_lines(correction[:, joint])[seen], seen)
    return tuple(found)


def _at_joint(
    joint: int, signals: Signals, scales: Scales, taught: Array, seen: NDArray[np.intp]
) -> list[FittedEffect]:
    place = Place(joint)
    tried = []
    for law in map(effect, PERIODIC):
        for theta in law.grid(place, scales):
            whole = to_lines(law.columns(place, signals, theta)[:, 0, :])
            if np.sum(whole[seen] ** 2) >= IN_SIGHT * np.sum(whole**2):
                tried.append(_Candidate(law, place, theta, whole[seen]))
    chosen: list[_Candidate] = []
    while tried and len(chosen) < MOST:
        basis = _basis(chosen, len(taught))
        left = taught - basis @ (basis.T @ taught)
        best = max(tried, key=lambda one: _explained(one.lines, basis, left))
        best = _refined(best, basis, left, signals, scales, seen)
        power, gain = float(left @ left), _explained(best.lines, basis, left)
        freedom = len(taught) - 2 * (len(chosen) + 1)
        chance = fisher.sf(gain / 2.0 / max((power - gain) / freedom, 1e-300), 2, freedom) * len(tried)
        if chance > FALSE_ALARM or gain < LEAST_SHARE * power:
            break
        chosen.append(best)
    if not chosen:
        return []
    columns = np.hstack([one.lines for one in chosen])
    values = np.asarray(np.linalg.lstsq(columns, taught, rcond=None)[0], dtype=float).reshape(-1, 2)
    return [fitted_effect(one.effect.name, place, one.theta, value) for one, value in zip(chosen, values, strict=True)]


def _lines(law: Effect, place: Place, signals: Signals, theta: Array, seen: NDArray[np.intp]) -> Array:
    return to_lines(law.columns(place, signals, theta)[:, 0, :])[seen]


def _basis(chosen: list[_Candidate], count: int) -> Array:
    if not chosen:
        return np.zeros((count, 0))
    return np.asarray(np.linalg.qr(np.hstack([one.lines for one in chosen]))[0])


def _explained(lines: Array, basis: Array, left: Array) -> float:
    """Power of ``left`` that the candidate's lines explain beside the basis; none where the basis has them nearly."""
    beside = lines - basis @ (basis.T @ lines)
    if np.any(np.sum(beside**2, axis=0) < TOLD_APART * np.sum(lines**2, axis=0)):
        return 0.0
    own = np.linalg.qr(beside)[0]
    return float(np.sum((own.T @ left) ** 2))


def _refined(
    one: _Candidate, basis: Array, left: Array, signals: Signals, scales: Scales, seen: NDArray[np.intp]
) -> _Candidate:
    """The best order between the grid's neighbours."""
    grid = one.effect.grid(one.place, scales)[:, 0]
    step = float(np.diff(grid).mean()) if len(grid) > 1 else 1.0

    def less(order: float) -> float:
        return -_explained(_lines(one.effect, one.place, signals, np.array([order]), seen), basis, left)

    order = float(one.theta[0])
    best = minimize_scalar(less, bounds=(order - step, order + step), method="bounded", options={"xatol": 1e-3})
    theta = np.array([float(best.x)])
    return _Candidate(one.effect, one.place, theta, _lines(one.effect, one.place, signals, theta, seen))
