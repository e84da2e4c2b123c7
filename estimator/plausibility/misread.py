"""Which other reading of the channels the given model explains far better than the channels as they came.

Beside what a free body can tell (`estimator.plausibility.hypotheses`), known links tell torques or angles that are
exchanged by themselves, a single joint's sign, zero or unit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from estimator.plausibility.doubt import Doubt, Kind, times
from estimator.plausibility.given_model import GivenModel
from estimator.plausibility.snapshot import CHANNELS, ORDERS, Snapshot
from estimator.plausibility.units import sizes_of_torques

Array = NDArray[np.float64]

_WELL = 0.04
"""Left of every joint: recordings need no other reading, and less than this is no better."""
_BETTER = 1.5
"""Nats, summed over the joints, by which less is left: of two joints each has to be less than half. Right recordings
of the stand-in's arms and of real ones reach 1.0, wrong ones 1.9 and more."""
_THERE = 0.5
"""Of what is left of a joint's own torque, what another unit or sign must bring it down to."""
_STEP = 0.3
"""Nats that each further exchange of two joints must bring."""
_ZEROS = tuple(0.25 * np.pi * k for k in (2, -2, 4, 1, -1, 3, -3))
"""By which conventions of a joint's zero differ."""
_UNLIKE = 3.0
"""Times that a joint's torque differs from what the given links make, to be in another unit and not of a motor whose
torque constant is off."""
_UNITS = (1e3, 1e-3, 1.0 / 9.80665, 10.0 / 0.980665, 1.0 / 0.0980665, 0.01 * 9.80665)
"""Times that one joint's torques may be off: mN·m, kN·m, kgf·m, kgf·cm and their like."""

_EXPLAINED = 0.3
"""`Judged.share` that the better reading must come down to: it is this arm then."""
UNRELATED = 0.4
"""Of what friction does not explain, what links that are about right never leave in a typical joint: recordings of
the stand-in's arms and of real ones leave 0.29 at the most, with the URDFs of other arms 0.53 and more."""


@dataclass(frozen=True)
class _Reading:
    shot: Snapshot
    kind: Kind
    joints: tuple[int, ...]
    left: Array
    order: tuple[int, ...] = ()
    size: float = 0.0


def misread(model: GivenModel, shot: Snapshot) -> list[Doubt]:
    """The one reading of a `thinned` snapshot that is far better than the channels as they came, and good; nothing
    when there is none."""
    judged = model.judged(shot)
    if judged is None or model.body.n < 2 or np.nanmax(judged.left) < _WELL:
        return []
    readings = [reading for reading in _readings(model, shot, judged.left) if _better_there(judged.left, reading)]
    best = max(readings, key=lambda reading: _gain(judged.left, reading.left), default=None)
    if best is None or _gain(judged.left, best.left) < _BETTER or replace(judged, left=best.left).share > _EXPLAINED:
        return []
    sprung = model.left(shot, sprung=True), model.left(best.shot, sprung=True)
    if sprung[0] is None or sprung[1] is None or _gain(sprung[0], sprung[1]) < _BETTER:
        return []
    return [_doubt(model.body.joints, best, judged.left)]


def _better_there(before: Array, reading: _Reading) -> bool:
    """Whether far less is left of the torque that would be read otherwise, or whose angle would be. Made a thousand
    times as large it outweighs all others, which are explained the better then, and itself no better: so strong springs
    at light wrists were kN·m, a tenth of themselves, or went with an angle that was said to be in degrees."""
    if reading.kind not in ("torque scale", "torque sign", "angles in degrees"):
        return True
    told = [joint for joint in reading.joints if np.isfinite(before[joint])]
    return all(reading.left[joint] < _THERE * before[joint] for joint in told)


def _gain(before: Array, after: Array) -> float:
    """Sum over the joints of the logarithm of how much less is left."""
    return float(np.nansum(np.log(np.maximum(before, _WELL) / np.maximum(after, _WELL))))


def _readings(model: GivenModel, shot: Snapshot, as_it_is: Array) -> Iterator[_Reading]:
    for kind, joint, size, other in _single(model, shot, as_it_is):
        left = model.left(other)
        if left is not None:
            yield _Reading(other, kind, (joint,), left, size=size)
    turned = replace(shot, tau=-shot.tau)
    left = model.left(turned)
    if left is not None:
        yield _Reading(turned, "torque sign", tuple(range(model.body.n)), left)
    backwards = list(range(model.body.n))[::-1]
    for kind in ORDERS:
        other = shot.of(kind, backwards)
        left = model.left(other)
        if left is not None:
            yield _Reading(other, kind, tuple(range(model.body.n)), left, tuple(backwards))
        found = _ordered(model, shot, kind, as_it_is)
        if found is not None:
            yield found


def _single(model: GivenModel, shot: Snapshot, as_it_is: Array) -> Iterator[tuple[Kind, int, float, Snapshot]]:
    n = model.body.n
    scales = sizes_of_torques(model.body, shot)
    for joint in np.flatnonzero(np.isfinite(as_it_is)).tolist():
        own = np.arange(n) == joint
        sign = np.where(own, -1.0, 1.0)
        turned = replace(shot, q=shot.q * sign, dq=shot.dq * sign, ddq=shot.ddq * sign)
        yield "torque sign", joint, 0.0, replace(shot, tau=shot.tau * sign)
        yield "joint turned round", joint, 0.0, replace(turned, tau=shot.tau * sign)
        yield "angle sign", joint, 0.0, turned
        if model.body.axes[joint].revolute:
            for zero in _ZEROS:
                yield "angle zero", joint, zero, replace(shot, q=shot.q + zero * own)
            radians = np.where(own, np.pi / 180.0, 1.0)
            read = replace(shot, q=shot.q * radians, dq=shot.dq * radians, ddq=shot.ddq * radians)
            yield "angles in degrees", joint, 0.0, read
        for unit in _sizes(as_it_is[joint], scales.get(joint)):
            yield "torque scale", joint, unit, replace(shot, tau=shot.tau / np.where(own, unit, 1.0))


def _sizes(left: float, scale: float | None) -> Sequence[float]:
    """Times that a joint's torques may be too large: the size that is measured, where the links are seen in them;
    else any unit, where they are not explained well."""
    if scale is None:
        return _UNITS if left > _WELL else ()
    return (scale,) if not 1.0 / _UNLIKE < scale < _UNLIKE else ()


def _ordered(model: GivenModel, shot: Snapshot, kind: Kind, as_it_is: Array) -> _Reading | None:
    """Exchanges of two joints, the best first, for as long as one helps."""
    n = model.body.n
    order, left = list(range(n)), as_it_is
    for _ in range(n - 1):
        trials = []
        for a, b in combinations(range(n), 2):
            trial = order.copy()
            trial[a], trial[b] = trial[b], trial[a]
            other = model.left(shot.of(kind, trial))
            if other is not None:
                trials.append((_gain(left, other), trial, other))
        gain, trial, other = max(trials, key=lambda t: t[0], default=(0.0, order, left))
        if gain < _STEP:
            break
        order, left = trial, other
    moved = tuple(j for j, k in enumerate(order) if j != k)
    return _Reading(shot.of(kind, order), kind, moved, left, tuple(order)) if moved else None


def _doubt(names: Sequence[str], reading: _Reading, as_it_is: Array) -> Doubt:
    joints = tuple(names[j] for j in reading.joints)
    ratio = reading.left / np.maximum(as_it_is, 1e-9)
    # Of its own joint, where it is one joint's unit; the others only go with it.
    worst = reading.joints[0] if reading.kind == "torque scale" else int(np.nanargmin(ratio))
    before, after = 100.0 * as_it_is[worst], 100.0 * reading.left[worst]
    gain = f"{before:.3g} % of the torque of {names[worst]} contradicts the model, {after:.3g} % if"
    if reading.kind in ORDERS:
        what = CHANNELS[reading.kind]
        order = ", ".join(f"{names[k]} as {names[j]}" for j, k in enumerate(reading.order) if j != k)
        problem, remedy = f"{what} are out of order: {gain} one reads {order}", f"put the {what} in the URDF's order"
    elif reading.kind == "torque sign":
        problem, remedy = f"the torque of {', '.join(joints)} has the wrong sign: {gain} it is turned", "turn its sign"
    elif reading.kind == "angle sign":
        problem = f"the angle of {joints[0]} runs the other way round than its torque and the URDF: {gain} it is turned"
        remedy = "turn the sign of its angle and velocity"
    elif reading.kind == "joint turned round":
        problem = f"{joints[0]} is recorded the other way round than in the URDF: {gain} it is turned"
        remedy = "turn the sign of its angle, velocity and torque, or check that the URDF is this arm's"
    elif reading.kind == "angles in degrees":
        problem, remedy = f"the angle of {joints[0]} is in degrees: {gain} it is so read", "convert it to rad"
    elif reading.kind == "angle zero":
        degrees = np.degrees(reading.size)
        problem = f"the angle of {joints[0]} has another zero than in the URDF: {gain} {degrees:+.0f}° are added"
        remedy = "take the URDF's zero, or check that the URDF is this arm's"
    else:
        problem = f"the torque of {joints[0]} is {times(reading.size)} times as large as in N·m: {gain} it is so read"
        remedy = "convert it to N·m at the joint"
    return Doubt(reading.kind, joints, problem, remedy, float(ratio[worst]), True)
