"""A first look at the frictions: what else recurs, and how sure the torques are where the joints turn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Design, stretch_rows
from estimator.diagnosis.evidence.grams import Sheet, total
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.stretches import Stretch
from estimator.diagnosis.observed.turning import REST, Turning, most_likely, standing, stands_throughout
from estimator.filtering import Decimator

Array = NDArray[np.float64]

_DRY = ("coulomb_friction", "presliding")
_LAWS = (*_DRY, "viscous_friction")
_LOUD = 2.0
"""Standard deviations of the noise, below which the reversals of a dry friction are not to be seen."""
_EVENLY = 3.0**-0.5
"""Of its level, the standard deviation of a dry friction that holds a joint by any torque within it."""
_HOLDS = 0.05
"""Standard deviations of the noise, below which rests are no less sure for it than by their noise."""
_TOLD = 1e-10
"""Of the largest direction of all columns, made alike: in smaller ones they differ by rounding."""


@dataclass(frozen=True)
class FirstLook:
    """The frictions of all joints, fitted together to all rows."""

    design: Design
    """With the laws of friction alone that a first look knows."""
    value: Array
    """(size,) of its unknowns."""
    left: tuple[Array, ...]
    """(samples, channels) of each stretch: what they leave of its residual."""


def first_look(design: Design, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise) -> FirstLook:
    """What the laws of friction, all of them together, leave of each stretch under this noise."""
    laws = [c for c in design.candidates if design.hypotheses[c.hypothesis].effect.name in _LAWS]
    look = design.with_candidates(laws)
    value = _fitted(look, [stretch_rows(look, *piece, noise) for piece in zip(pieces, decimations, strict=True)])
    samples = Noise.none(len(look.channels), past=0)
    left = []
    for piece in pieces:
        rows = stretch_rows(look, piece, 1, samples)
        left.append(np.array([x[-1] - value[own] @ x[:-1] for own, x in zip(look.members, rows, strict=True)]).T)
    return FirstLook(look, value, tuple(left))


def held(look: FirstLook, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise) -> dict[int, float]:
    """By channel the standard deviation, N·m, of what its joint is held by where it stands, of those in which that is
    to be seen beside the noise."""
    still = standing_throughout(pieces)
    torques = [k for k, channel in enumerate(look.design.channels) if channel.equation == "torque"]
    found = {k: _held(look, pieces, decimations, k, still) for k in torques}
    return {k: level for k, level in found.items() if level > _HOLDS * noise.likely[k]}


def held_at(
    look: FirstLook, pieces: Sequence[Stretch], decimations: Sequence[int], channels: Iterable[int]
) -> list[Array]:
    """(samples, channels) of each stretch: one where the joint of one of these ``channels`` stands, else zero."""
    result = [np.zeros((piece.signals.samples, len(look.design.channels))) for piece in pieces]
    for number in channels:
        joint = look.design.channels[number].index
        for piece, step, own in zip(pieces, decimations, result, strict=True):
            own[:, number] = standing(piece.signals.q[:, joint], piece.signals.dq[:, joint], REST * step) > 0.0
    return result


def with_turns(
    look: FirstLook,
    pieces: Sequence[Stretch],
    decimations: Sequence[int],
    noise: Noise,
    holding: Mapping[int, float],
    playings: int,
) -> Noise:
    """The noise with the errors of reversals beside it, of the channels that show any, and of what `held` says
    (``holding``): any torque within a dry friction's level, and the same in all ``playings`` of a motion."""
    result = {}
    for number, channel in enumerate(look.design.channels):
        if channel.equation != "torque":
            continue
        turning = _reversals(look, pieces, decimations, noise, number)
        turning = replace(turning, held=holding.get(number, 0.0) * playings**0.5)
        if turning.error > 0.0 or turning.held > 0.0:
            result[number] = turning
    return replace(noise, turning=result)


def standing_throughout(pieces: Sequence[Stretch]) -> list[int]:
    """Joints that never move."""
    q = np.concatenate([piece.signals.q for piece in pieces])
    return [joint for joint in range(q.shape[1]) if stands_throughout(q[:, joint])]


def _reversals(
    look: FirstLook, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise, number: int
) -> Turning:
    """The errors of a channel's reversals; zero where there are hardly any."""
    joint = look.design.channels[number].index
    friction, span = _dry(look, joint), float(max(np.ptp(piece.signals.q[:, joint]) for piece in pieces))
    if friction < _LOUD * noise.likely[number]:
        return Turning(joint, 0.0, span)
    spreads = {step: noise.spread(number, step) for step in set(decimations)}
    rows = [Decimator(step)(own[:, [number]].T) for step, own in zip(decimations, look.left, strict=True)]
    error, way = most_likely(
        [noise.whiten(number, own)[0] for own in rows],
        [piece.signals.q[:, joint] for piece in pieces],
        [spreads[step] for step in decimations],
        friction,
        span,
    )
    return Turning(joint, error, way)


def _held(
    look: FirstLook, pieces: Sequence[Stretch], decimations: Sequence[int], number: int, still: Sequence[int]
) -> float:
    """N·m, standard deviation of what a channel's joint is held by in rests; zero where it has none. Of a joint that
    never moves (``still``) the friction is not known, and may be all that the torque is off by."""
    joint = look.design.channels[number].index
    motions = [(piece.signals.q[:, joint], piece.signals.dq[:, joint]) for piece in pieces]
    if joint in still:
        return float(max(np.abs(piece.residual[:, number]).max() for piece in pieces))
    rests = any(np.any(standing(*motion, REST * step)) for motion, step in zip(motions, decimations, strict=True))
    return max(_dry(look, joint), 0.0) * _EVENLY if rests else 0.0


def _fitted(look: Design, rows: Sequence[Sequence[Array]]) -> Array:
    """(size,) all unknowns together: all widths of a sign, all bristles, the viscous frictions and the given model's.
    What no sum of them explains of a reversal, no single one does; how it is shared among them does not matter."""
    whole = total([Sheet(0, list(stretch), 0.0) for stretch in rows])
    told = Weighted(look, whole, np.ones(len(look.channels)))
    matrix = told.with_all(np.arange(look.size))
    matrix[: look.given, : look.given] += look.precision
    diagonal = np.diag(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    solved, *_ = np.linalg.lstsq(matrix * np.outer(scale, scale), told.with_residual * scale, rcond=_TOLD)
    return np.asarray(solved * scale)


def _dry(look: FirstLook, joint: int) -> float:
    """N·m of a joint's dry friction in motion."""
    result = 0.0
    for candidate in look.design.candidates:
        hypothesis = look.design.hypotheses[candidate.hypothesis]
        if hypothesis.effect.name in _DRY and hypothesis.place.joint == joint:
            result += float(look.value[candidate.columns].sum())
    return result
