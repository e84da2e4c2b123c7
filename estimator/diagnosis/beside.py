"""Causes beside the arm's own model, in its drives or gears: put into the arm's diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from estimator.diagnosis.diagnose import verdict
from estimator.diagnosis.evidence.grams import total
from estimator.diagnosis.evidence.torques import plain_blocks, residual_power
from estimator.diagnosis.naming.judging import Judged
from estimator.diagnosis.naming.restless import restless, restless_note
from estimator.diagnosis.naming.unexplained import without_name
from estimator.diagnosis.telling.answer import Diagnosis, Finding, Residual
from estimator.diagnosis.telling.traces import signatures, unit_of_channel


def at_channel(judged: Judged, channel: str) -> Judged:
    """The same with the places of all findings, and of their alternatives, at a channel; no motion is designed for
    them."""
    return replace(judged, findings=tuple(_at(finding, channel) for finding in judged.findings))


def _at(finding: Finding, channel: str) -> Finding:
    rivals = tuple(replace(a, place=replace(a.place, channel=channel)) for a in finding.rivals)
    near = tuple(replace(a, place=replace(a.place, channel=channel)) for a in finding.alternatives)
    place = replace(finding.place, channel=channel)
    return replace(finding, place=place, alternatives=near, rivals=rivals, contest=None)


def put_beside(found: Diagnosis, judged: Judged) -> Diagnosis:
    """The arm's diagnosis with causes that were judged apart from it, and the verdict of both."""
    evidence, refined = judged.evidence, judged.named
    names = refined.design.body.joints
    drawn = signatures(refined, evidence.pieces, evidence.grid, evidence.noise.likely, names)
    findings = (*found.findings, *judged.findings)
    there = {
        joint: replace(left, signature=f"{left.signature}, between its motor and its sensor")
        for joint, left in (restless(judged.refined, judged.widest) | without_name(judged.nameless)).items()
    }
    unexplained = there | found.unexplained
    return replace(
        found,
        verdict=verdict(findings, unexplained),
        findings=findings,
        unexplained=unexplained,
        notes=(*found.notes, *restless_note(evidence.design)),
        traces=replace(found.traces, signatures=(*found.traces.signatures, *drawn)),
    )


def residuals(judged: Judged) -> Mapping[int, Residual]:
    """By joint, what was there before and is after the causes."""
    evidence, refined = judged.evidence, judged.named
    rows = total(plain_blocks(refined.design, evidence.pieces, evidence.decimations))
    before = np.sqrt(residual_power(refined.design, rows, np.zeros(refined.design.size)))
    after = np.sqrt(residual_power(refined.design, rows, refined.value))
    return {
        channel.index: Residual(
            float(before[k]),
            float(after[k]),
            float(evidence.noise.likely[k]),
            unit_of_channel(refined.design.body, channel),
        )
        for k, channel in enumerate(evidence.grid.channels)
    }
