"""A first look at the frictions: what else recurs, and how sure the torques are where the joints turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.design import Design, stretch_rows
from estimator.diagnosis.grams import Sheet, total
from estimator.diagnosis.noise import Noise
from estimator.diagnosis.stretches import Stretch
from estimator.diagnosis.turning import Turning, most_likely
from estimator.diagnosis.weighted import Weighted
from estimator.filtering import Decimator

Array = NDArray[np.float64]

_DRY = ("coulomb_friction", "presliding")
_LAWS = (*_DRY, "viscous_friction")
_LOUD = 2.0
"""Standard deviations of the noise, below which the reversals of a dry friction are not to be seen."""
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


def with_turns(look: FirstLook, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise) -> Noise:
    """The noise with the errors of reversals beside it, of the channels that show any."""
    span = np.max([np.ptp(piece.signals.q, axis=0) for piece in pieces], axis=0)
    decimators = [Decimator(step) for step in decimations]
    result = {}
    for number, channel in enumerate(look.design.channels):
        friction = _dry(look, channel.index)
        if channel.equation != "torque" or friction < _LOUD * noise.likely[number]:
            continue
        spreads = {step: noise.spread(number, step) for step in set(decimations)}
        rows = [decimate(own[:, [number]].T) for decimate, own in zip(decimators, look.left, strict=True)]
        error, way = most_likely(
            [noise.whiten(number, own)[0] for own in rows],
            [piece.signals.q[:, channel.index] for piece in pieces],
            [spreads[step] for step in decimations],
            friction,
            float(span[channel.index]),
        )
        if error > 0.0:
            result[number] = Turning(channel.index, error, way)
    return replace(noise, turning=result)


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
