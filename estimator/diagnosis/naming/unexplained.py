"""What no cause explains: torques whose residual is beyond the noise, joint by joint, with its signature."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.forms import FORM, beside_forms, forms_of
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.torques import torque_channels
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.lack_of_fit import misfits
from estimator.diagnosis.naming.restless import restless
from estimator.diagnosis.naming.ringing import ringing
from estimator.diagnosis.telling.answer import Finding, Unexplained
from estimator.effects import catalogue

Array = NDArray[np.float64]

SIGNIFICANT = 3.5
"""Standard errors by which a residual must exceed the noise to be called unexplained, and a cause nothing."""
VISIBLE = 0.35
"""Of the noise's variance: less than this, of no quantity in particular, may be an error of the noise model."""


def unexplained_by(
    evidence: Evidence,
    scores: Scores,
    refined: Refined,
    chosen: list[int],
    nameless: Sequence[Finding],
    instead: Sequence[Sequence[int]] = (),
) -> dict[int, Unexplained]:
    """By joint, the torques whose residual is beyond the noise: as a whole, as a function of one quantity, as by a law
    that one part of the motions alone shows, or as by one at a shape that makes it ``nameless``. What goes with a
    quantity and is not left by causes that are as good, ``instead`` of the chosen, has their names. What is a matter of
    a friction's form (`beside_forms`) has none of its own."""
    result = _beside(beside_forms, evidence, scores, refined, chosen, instead)
    # Forms excuse: what fewer of them leave nothing of is not told for what stands out beside more.
    told = _beside(_beside_fewer, evidence, scores, refined, chosen, instead)
    result = {joint: left for joint, left in result.items() if joint in told}
    refused = Admission(scores).one_sided(chosen) if evidence.noise.playings else None
    if refused is not None:
        explained = scores.explained([refused], chosen)
        channel = max(torque_channels(evidence.design), key=lambda k: explained[k])
        name = scores.hypothesis(refused).effect.name.replace("_", " ")
        before, after = _variances(scores, refined, chosen, beside_forms(scores, chosen))
        share = float(
            explained[channel] / max(before[channel] - after[channel] + explained[channel], scores.noise_error)
        )
        left = Unexplained(min(share, 1.0), f"as by {name}, in one part of the motions alone")
        if share > FORM:
            result.setdefault(evidence.grid.channels[channel].index, left)
    for joint, own in restless(refined, scores).items():
        if joint not in result or own.share > result[joint].share:
            result[joint] = own
    return result | without_name(nameless)


def _beside_fewer(scores: Scores, chosen: Sequence[int]) -> list[int]:
    return [*chosen, *forms_of(scores, chosen)]


def _beside(
    forms: Callable[[Scores, Sequence[int]], list[int]],
    evidence: Evidence,
    scores: Scores,
    refined: Refined,
    chosen: list[int],
    instead: Sequence[Sequence[int]],
) -> dict[int, Unexplained]:
    """By joint, what is beyond the noise as a whole, or as a function of one quantity, beside the chosen and their
    ``forms``."""
    formed = forms(scores, chosen)
    before, after = _variances(scores, refined, chosen, formed)
    found = misfits(scores, formed)
    result = {}
    for channel in torque_channels(evidence.design):
        joint = evidence.grid.channels[channel].index
        misfit = found[channel]
        # An assumed noise has an assumed colour: within it no pattern is more than that.
        told = misfit.told and (evidence.noise.playings > 0 or after[channel] > 1.0)
        told = told and all(misfits(scores, forms(scores, others))[channel].told for others in instead)
        # A noise that is less than it was taken for is at most what such a pattern leaves.
        noise = min(1.0, after[channel] - misfit.variance if told else after[channel])
        left = after[channel] - noise
        share = float(min(left / max(before[channel] - noise, left, scores.noise_error), 1.0))
        if (told and share > FORM) or left > max(SIGNIFICANT * scores.noise_error, VISIBLE):
            result[joint] = Unexplained(
                share, _signature(scores, misfit.candidate) if told else _of_time(evidence, refined, channel)
            )
    return result


def _variances(scores: Scores, refined: Refined, chosen: list[int], formed: list[int]) -> tuple[Array, Array]:
    """(channels,) of the residual before the chosen, and after them as they are ``formed``, of the noise's."""
    rows = scores.total.rows
    of_forms = scores.model(chosen).squares() - scores.model(formed).squares()
    return scores.model([]).squares() / rows, (refined.model.squares() - of_forms) / rows


def _of_time(evidence: Evidence, refined: Refined, channel: int) -> str:
    line = ringing(evidence, refined, channel)
    return "of no single quantity" if line is None else f"ringing at {line:.2g} Hz, as of a load that swings"


def without_name(nameless: Sequence[Finding]) -> dict[int, Unexplained]:
    """By joint, laws at shapes that no thing of their name has, as what they look like."""
    return {
        one.place.joint: Unexplained(one.share_of_explainable, catalogue()[one.effect].beyond_known)
        for one in nameless
        if one.place.joint is not None
    }


def _signature(scores: Scores, candidate: int) -> str:
    hypothesis = scores.hypothesis(candidate)
    whose = "" if hypothesis.place.other is None else f" of {scores.design.body.joints[hypothesis.place.other]}"
    return hypothesis.effect.name.replace("map of", "a function of") + whose
