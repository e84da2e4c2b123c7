"""Laws that go with the model's torque, by the links as the recordings have them.

What winds a spring up, or is multiplied by a ripple, is the torque that the links really need. The given model's is off
by its tolerance, which for a joint that gravity hardly loads may be half of it; the deviations are unknowns of the
torques, and once causes are found they are known far better than that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Candidate, candidate_columns
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.grams import sheets
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.observed.stretches import Stretch
from estimator.diagnosis.observed.tolerance import link_covariance
from estimator.effects import Signals

Array = NDArray[np.float64]

_WORTH = 3.0
"""nats that a cause must be expected to explain more with the other links."""
_KINEMATIC = ("regressor", "reach", "tip", "distinguishable")
"""Of what was worked out of a motion, what no link's mass changes."""


def with_bent_links(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """The evidence with columns of the links that were fitted beside the ``chosen``; None where they would change none
    of these, or where the model has links without mass, whose torques it does not know at all."""
    design = evidence.design
    if evidence.tolerance is None or np.any(design.body.prior()[::10] <= 0.0):
        return None
    spread = link_covariance(design.body, evidence.tolerance) @ design.base.combination.T
    change = spread @ np.linalg.lstsq(design.base.combination @ spread, refined.value[: design.base.rank])[0]
    pieces = bent(evidence.pieces, change)
    if not any(_matters(evidence, scores, list(chosen), k, pieces) for k in chosen):
        return None
    made = sheets(design, pieces, evidence.decimations, evidence.noise, evidence.parts)
    return replace(
        evidence,
        pieces=tuple(pieces),
        blocks=tuple(sheet.compact() for sheet in made),
        slow=cache(lambda: bent(evidence.slow(), change)),
        bend=change,
    )


def bent(pieces: Sequence[Stretch], change: Array | None) -> list[Stretch]:
    """The same stretches with the motion's torques and inertias of other links, their parameters (10·n,) different by
    ``change``; what is left of the measured torques stays that of the given model."""
    return list(pieces) if change is None else [replace(p, signals=_bent(p.signals, change)) for p in pieces]


def _bent(signals: Signals, change: Array) -> Signals:
    body = signals.body.with_parameters(signals.body.prior() + change)
    other = replace(signals, body=body, tau_rigid=signals.tau_rigid + signals.regressor @ change)
    other.__dict__.update({name: x for name, x in signals.__dict__.items() if name in _KINEMATIC})
    return other


def _matters(evidence: Evidence, scores: Scores, chosen: list[int], candidate: int, pieces: Sequence[Stretch]) -> bool:
    """Whether a cause may explain more with other links."""
    own = evidence.design.candidates[candidate]
    return nats_changed(evidence, scores, chosen, candidate, own, pieces) > _WORTH


def nats_changed(
    evidence: Evidence, scores: Scores, chosen: list[int], candidate: int, other: Candidate, pieces: Sequence[Stretch]
) -> float:
    """Of what a cause explains, the share of its columns' energy that changes where they are those of the ``other``
    along these pieces."""
    own = evidence.design.candidates[candidate]
    changed, whole = 0.0, 0.0
    for before, after in zip(evidence.pieces, pieces, strict=True):
        columns = candidate_columns(evidence.design, own, before.signals)
        changed += float(np.sum((candidate_columns(evidence.design, other, after.signals) - columns) ** 2))
        whole += float(np.sum(columns**2))
    gain = scores.nats(chosen) - scores.nats([k for k in chosen if k != candidate])
    return gain * changed / max(whole, np.finfo(float).tiny)
