"""Frictions that are others in each recording, seen by what the causes leave."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Design
from estimator.diagnosis.evidence.forms import FORM
from estimator.diagnosis.evidence.gathered import Evidence, weighed_again
from estimator.diagnosis.evidence.own_frictions import (
    apart_by,
    fitted_with_own,
    of_own_frictions,
    spreads_of,
    with_own_frictions,
)
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.torques import torque_channels
from estimator.diagnosis.naming.admission import FALSE_ALARM, LEAST_SEEN
from estimator.diagnosis.naming.lack_of_fit import misfits
from estimator.diagnosis.telling.answer import Unexplained

Array = NDArray[np.float64]

_MOST = 0.5
"""Of what causes leave of a torque beyond its noise, what its joint's own frictions must explain."""
_STILL = 1e-3
"""Of the spread that own frictions were found to have: none, and it can be compared with them."""
_AS_MUCH = np.log(2.0)
"""Spreads that differ by less are the same."""
RESTLESS = "a friction that is another one in each recording"


def with_restless_frictions(
    evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined
) -> Evidence | None:
    """The evidence with frictions of their own in each recording, differing as much as they do beside the ``chosen``
    causes, ``refined``: of the joints that had some and still do, and of those where playings tell the noise, and these
    explain most of what the causes leave, and more than any quantity does. None where nothing would change."""
    design = evidence.design
    asked = torque_channels(design) if evidence.noise.playings else list(design.restless)
    if design.recordings < 2 or not asked:
        return None
    shown = evidence.pieces, evidence.decimations, evidence.noise, scores.weights
    model = fitted_with_own(refined.design, asked, *shown)
    spreads, before, rows = spreads_of(model.design), spreads_of(design), model.told.block.rows
    explained = (refined.model.squares() - model.squares()) / rows
    left = np.maximum(refined.model.squares() / rows - 1.0, 0.0)
    # What goes with a quantity differs too, where motions do.
    of_quantities = {k: misfit.variance for k, misfit in misfits(scores, list(chosen)).items()}
    least = np.log(len(asked) / FALSE_ALARM)
    found = {k: spreads[k] for k in design.restless if of_own_frictions(model, k) > LEAST_SEEN}
    for channel in (k for k in asked if k not in design.restless):
        still = with_own_frictions(model.design, spreads | {channel: _STILL * spreads[channel]})
        without = Conditional(model.told.believed(apart_by(still)), model.active)
        gain = model.log_evidence - without.log_evidence
        if gain > least and explained[channel] > max(_MOST * left[channel], of_quantities[channel], LEAST_SEEN):
            found[channel] = spreads[channel]
    same = [k for k in found if k in before and np.all(np.abs(np.log(found[k] / before[k])) < _AS_MUCH)]
    if len(same) == len(found) == len(before):
        return None
    wide = with_own_frictions(design, found)
    return weighed_again(evidence, wide, evidence.unseen, evidence.pieces, evidence.slow)


def restless(refined: Refined, scores: Scores) -> dict[int, Unexplained]:
    """By joint with frictions of its own in each recording, the share that these have of what can be explained, where
    it is more than a law's form is exact to."""
    before, result = scores.model([]).squares() / scores.total.rows, {}
    for channel in refined.design.restless:
        spent = of_own_frictions(refined.model, channel)
        share = spent / max(float(before[channel]) - 1.0, spent, scores.noise_error)
        if share > FORM:
            result[refined.design.channels[channel].index] = Unexplained(share, RESTLESS, nameless=False)
    return result


def restless_note(design: Design) -> list[str]:
    """A sentence about such joints, where there are some."""
    if not design.restless:
        return []
    rub = ", ".join(design.body.joints[design.channels[k].index] for k in design.restless)
    return [
        f"the friction of {rub} is another one in each recording, and goes with nothing that was recorded: what is "
        "told of it is the mean; record the joints' temperatures, or warm the arm up first"
    ]
