"""The whole way from recordings and the given model to named causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.first_look import standing_throughout
from estimator.diagnosis.evidence.gathered import Evidence, cut, gather
from estimator.diagnosis.evidence.grams import sum_up, total
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.torques import (
    left_out_power,
    plain_blocks,
    residual_power,
    share_of_explainable,
    torque_channels,
)
from estimator.diagnosis.naming.detectable import smallest_detectable
from estimator.diagnosis.naming.judging import Judged, judge
from estimator.diagnosis.naming.late_torques import as_fitted
from estimator.diagnosis.naming.restless import restless_note
from estimator.diagnosis.naming.unexplained import SIGNIFICANT, unexplained_by
from estimator.diagnosis.observed.first_body import has_bodies
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.stretches import Stretch
from estimator.diagnosis.telling.answer import Alternative, Diagnosis, Finding, HeldOut, Residual, Unexplained, Verdict
from estimator.diagnosis.telling.traces import Traces, traces
from estimator.differences import with_speeds_of_their_own
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_WORTH_TELLING = 0.12
"""Of the explainable: a smaller share that is left does not make the verdict unknown."""


def diagnose(
    body: RigidBody,
    trajectories: Sequence[Trajectory],
    hold_out: Sequence[Trajectory] = (),
    tolerance: float = 0.05,
    drives_off: Sequence[Trajectory] = (),
) -> Diagnosis:
    """Names what the given model gets wrong.

    ``tolerance``: relative standard deviation to which the model's inertial parameters are believed. ``hold_out``:
    recordings on which the gain is measured; without them, data left out in turn. ``drives_off``: recordings at rest
    with the drives off, whose torques are their offsets.
    Raises InputError for recordings that cannot be judged.
    """
    own = with_speeds_of_their_own(trajectories)
    judged = judge(gather(body, own, tolerance, drives_off))
    evidence, scores, refined, findings = judged.evidence, judged.scores, judged.named, judged.findings
    chosen = list(judged.chosen)
    given, body = body, evidence.design.body
    unexplained = unexplained_by(evidence, judged.widest, judged.refined, chosen, judged.nameless, judged.instead)
    sizes, units = smallest_detectable(scores, chosen)
    return Diagnosis(
        joints=body.joints,
        verdict=verdict(findings, unexplained),
        findings=findings,
        unexplained=unexplained,
        torque_residual=_residuals(evidence, refined),
        held_out=_held_out(evidence, scores, refined, body, hold_out),
        smallest_detectable=sizes,
        detectable_units=units,
        notes=tuple(_notes(evidence, given, tolerance, judged, own[0].dq is trajectories[0].dq)),
        traces=_traces(evidence, refined, body, hold_out),
        band=evidence.grid.band,
        base_deviation=_deviation(evidence, refined, given),
    )


def verdict(findings: Sequence[Finding], unexplained: dict[int, Unexplained]) -> Verdict:
    """Of findings and of what no finding explains, by joint. That a friction is another one in each recording is no
    doubt about its name."""
    if any(left.nameless and left.share > _WORTH_TELLING for left in unexplained.values()):
        return "unknown"
    if not findings:
        return "clean"
    return "ambiguous" if any(finding.status == "ambiguous" for finding in findings) else "named"


def _residuals(evidence: Evidence, refined: Refined) -> tuple[Residual, ...]:
    design = refined.design
    whole = total(plain_blocks(design, evidence.pieces, evidence.decimations))
    before = np.sqrt(residual_power(design, whole, np.zeros(design.size)))
    after = np.sqrt(residual_power(design, whole, refined.value))
    return tuple(
        Residual(float(before[k]), float(after[k]), float(evidence.noise.likely[k]), axis.torque_unit)
        for k, axis in zip(torque_channels(design), design.body.axes, strict=True)
    )


def _held_out(
    evidence: Evidence, scores: Scores, refined: Refined, body: RigidBody, hold_out: Sequence[Trajectory]
) -> HeldOut:
    design = refined.design
    chosen = torque_channels(design)
    if hold_out:
        pieces = _others(evidence, body, hold_out)
        whole = total(plain_blocks(design, pieces, [evidence.grid.decimation(p.signals.period) for p in pieces]))
        before, after = (
            residual_power(design, whole, np.zeros(design.size)),
            residual_power(design, whole, refined.value),
        )
    else:
        plain = plain_blocks(design, evidence.pieces, evidence.decimations, evidence.parts, evidence.noise.past)
        whitened = sum_up(design, evidence.pieces, evidence.decimations, evidence.noise, evidence.parts)
        whole = total(plain)
        before = residual_power(design, whole, np.zeros(design.size))
        after = left_out_power(design, scores.weights, whitened, plain, evidence.folds.motions[: len(plain)])
    variance = evidence.noise.likely[chosen] ** 2
    freedom = evidence.noise.degrees_of_freedom or np.inf
    least = SIGNIFICANT * np.sqrt((2.0 / whole.rows + 2.0 / freedom) * len(chosen))
    return HeldOut(
        before=float(np.sqrt(np.mean(before[chosen]))),
        after=float(np.sqrt(np.mean(after[chosen]))),
        share_of_explainable=share_of_explainable(before[chosen] / variance, after[chosen] / variance, float(least)),
    )


def _traces(evidence: Evidence, refined: Refined, body: RigidBody, hold_out: Sequence[Trajectory]) -> Traces:
    """Shown on what was held out where there is some."""
    shown = _others(evidence, body, hold_out) if hold_out else evidence.pieces
    found = traces(refined, evidence.pieces, shown, evidence.grid, evidence.noise.likely, body.joints)
    return replace(found, recording=found.recording - evidence.recordings) if hold_out else found


def _others(evidence: Evidence, body: RigidBody, hold_out: Sequence[Trajectory]) -> list[Stretch]:
    """Stretches of recordings that were not learnt from, numbered after those that were."""
    pieces = as_fitted(evidence, cut(body, evidence.grid, hold_out))
    return [replace(piece, recording=evidence.recordings + piece.recording) for piece in pieces]


def _deviation(evidence: Evidence, refined: Refined, given: RigidBody) -> Array:
    """(rank,) of the base parameters from those of the model that was given."""
    base = evidence.design.base
    first = base.combination @ (evidence.design.body.prior() - given.prior())
    return np.asarray(first + refined.value[: base.rank])


def _shared_out(finding: Finding, other: Alternative, joints: Sequence[str]) -> str:
    """Of a finding and an alternative of another joint that no motion tells from it."""
    assert finding.place.joint is not None
    assert other.place.joint is not None
    one, another = joints[finding.place.joint], joints[other.place.joint]
    what = finding.effect.replace("_", " ")
    return (
        f"no motion tells the {what} of {one} from one of {another}, beside what both spend together: its ratio and "
        f"its size are told as they are with the {what} of {one}"
    )


def _notes(evidence: Evidence, given: RigidBody, tolerance: float, judged: Judged, own_speeds: bool) -> list[str]:
    notes = []
    if not own_speeds:
        notes.append("the speeds are differences of the angles, and are not compared with them")
    off = sorted(f.place.joint for f in judged.findings if f.effect == "link_inertia" and f.place.joint is not None)
    if len(off) > 1:
        notes.append(
            f"the links of {', '.join(given.joints[k] for k in off)} are all off by more than the tolerance of "
            f"{100.0 * tolerance:.3g} %: make sure that the model is this arm's, and its links known so well"
        )
    if judged.borne_out is not None:
        notes.append(
            f"the links fit these recordings to {100.0 * judged.borne_out:.3g} %, where the tolerance is "
            f"{100.0 * tolerance:.3g} %: causes are judged by links that are as exact as that"
        )
    late = any(finding.effect == "transport_delay" for finding in judged.findings)
    if judged.punctual and late:
        notes.append(
            "the other channels of these recordings are in time to a small part of a sample: what is late is judged by "
            "that"
        )
    if not has_bodies(given):
        notes.append(
            "the model has no masses: its links are those that fit these recordings, and no cause is sought there"
        )
    if (reading := evidence.design.reading) is not None and reading.silent:
        silent = ", ".join(given.joints[k] for k in reading.silent)
        notes.append(f"the drives of {silent} measure nothing while they are off: their offsets are not read")
    if still := standing_throughout(evidence.pieces):
        stand = ", ".join(given.joints[k] for k in still)
        notes.append(
            f"{stand} never moved: friction may hold it by any torque, so that nothing is said of what acts there; "
            "record a motion of it"
        )
    notes += [
        _shared_out(f, other, given.joints)
        for f in judged.findings
        for other in f.alternatives[:1]
        if not other.decidable
    ]
    notes += restless_note(evidence.design)
    noise: Noise = evidence.noise
    if noise.playings:
        notes.append(f"noise from {noise.playings} playings of {len(evidence.repeats)} repeated motions")
    else:
        notes.append(
            "no motion was played twice: the noise is assumed, and may be as large as all that is left; "
            "play each motion twice to see smaller effects"
        )
    return notes
