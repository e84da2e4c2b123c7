"""A first look at the frictions: how sure the torques are where the joints turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.conditional import products
from estimator.diagnosis.design import Design, stretch_rows
from estimator.diagnosis.grams import Sheet, total
from estimator.diagnosis.noise import Noise
from estimator.diagnosis.stretches import Stretch
from estimator.diagnosis.turning import Turning, most_likely

Array = NDArray[np.float64]

_DRY = ("coulomb_friction", "presliding")
_LAWS = (*_DRY, "viscous_friction")
_LOUD = 2.0
"""Standard deviations of the noise, below which the reversals of a dry friction are not to be seen."""
_TOLD = 1e-10
"""Of the largest direction of all columns, made alike: in smaller ones they differ by rounding."""


def with_turns(design: Design, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise) -> Noise:
    """The noise with the errors of reversals beside it, of the channels that show any."""
    laws = [c for c in design.candidates if design.hypotheses[c.hypothesis].effect.name in _LAWS]
    look = design.with_candidates(laws)
    rows = [stretch_rows(look, piece, step, noise) for piece, step in zip(pieces, decimations, strict=True)]
    value = _fitted(look, rows)
    span = np.max([np.ptp(piece.signals.q, axis=0) for piece in pieces], axis=0)
    result = {}
    for number, channel in enumerate(look.channels):
        friction = _dry(look, value, channel.index)
        if channel.equation != "torque" or friction < _LOUD * noise.likely[number]:
            continue
        own = value[look.members[number]]
        spreads = {step: noise.spread(number, step) for step in set(decimations)}
        error, way = most_likely(
            [stretch[number][-1] - own @ stretch[number][:-1] for stretch in rows],
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
    weights, everything = np.ones(len(look.channels)), np.arange(look.size)
    whole = total([Sheet(0, list(stretch), 0.0) for stretch in rows])
    matrix = products(look, whole, weights, everything, everything)
    matrix[: look.given, : look.given] += look.precision
    right = np.zeros(look.size)
    for members, gram in zip(look.members, whole.grams, strict=True):
        right[members] += gram[:-1, -1]
    diagonal = np.diag(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    solved, *_ = np.linalg.lstsq(matrix * np.outer(scale, scale), right * scale, rcond=_TOLD)
    return np.asarray(solved * scale)


def _dry(look: Design, value: Array, joint: int) -> float:
    """N·m of a joint's dry friction in motion."""
    result = 0.0
    for candidate in look.candidates:
        hypothesis = look.hypotheses[candidate.hypothesis]
        if hypothesis.effect.name in _DRY and hypothesis.place.joint == joint:
            result += float(value[candidate.columns].sum())
    return result
