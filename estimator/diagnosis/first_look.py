"""A first look at the frictions: how sure the torques are where the joints turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.conditional import Conditional
from estimator.diagnosis.design import Design, stretch_rows
from estimator.diagnosis.grams import Sheet, total
from estimator.diagnosis.noise import Noise
from estimator.diagnosis.stretches import Stretch
from estimator.diagnosis.turning import Turning, most_likely

Array = NDArray[np.float64]

_DRY = ("coulomb_friction", "presliding")
_LOUD = 2.0
"""Standard deviations of the noise, below which a dry friction's reversals are not to be seen."""


def with_turns(design: Design, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise) -> Noise:
    """The noise with the errors of reversals beside it, of the joints whose torques show any.

    All widths of a sign and all bristles together, with the viscous frictions and the given model: what no sum of them
    explains of a reversal, no single one does.
    """
    names = [design.hypotheses[c.hypothesis].effect.name for c in design.candidates]
    laws = [c for c, name in zip(design.candidates, names, strict=True) if name in (*_DRY, "viscous_friction")]
    look = design.with_candidates(laws)
    rows = [stretch_rows(look, piece, step, noise) for piece, step in zip(pieces, decimations, strict=True)]
    whole = total([Sheet(0, own, 0.0) for own in rows])
    value = Conditional(look, whole, np.ones(len(look.channels)), np.arange(look.size)).value
    result = {}
    for number, channel in enumerate(look.channels):
        if channel.equation != "torque":
            continue
        dry = [
            c
            for c in look.candidates
            if (law := look.hypotheses[c.hypothesis]).effect.name in _DRY and law.place.joint == channel.index
        ]
        friction = float(sum(value[c.columns].sum() for c in dry))
        if friction < _LOUD * noise.likely[number]:
            continue
        own = value[look.members[number]]
        residuals = [own_rows[number][-1] - own @ own_rows[number][:-1] for own_rows in rows]
        angles = [piece.signals.q[:, channel.index] for piece in pieces]
        spreads = {step: noise.spread(number, step) for step in set(decimations)}
        span = max(float(np.ptp(q)) for q in angles)
        error, way = most_likely(residuals, angles, [spreads[step] for step in decimations], friction, span)
        if error > 0.0:
            result[number] = Turning(channel.index, error, way)
    return replace(noise, turning=result)
