"""A line is one that stands out of the spectrum it is in, and a ripple is within what a motor's torque can have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.refinement import fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.fine_lines import with_fine_lines
from estimator.diagnosis.naming.judging import judge
from estimator.diagnosis.naming.plainer import without_menders

Array = NDArray[np.float64]
Play = Callable[..., list[Trajectory]]
FIRST = np.array([1.0, 0.0])
ORDERS = (9.0, 23.0, 41.0)


def lines(q: Array) -> Array:
    return FIRST * sum(0.4 * np.sin(order * q[:, [0]] + order) for order in ORDERS)


def pushes(q: Array) -> Array:
    """At three places, a hundredth of a radian wide."""
    return FIRST * sum(20.0 * np.exp(-(((q[:, [0]] - place) / 0.01) ** 2)) for place in (0.05, 0.3, -0.5))


@pytest.mark.parametrize(("law", "stands"), [(lines, True), (pushes, False)])
def test_pushes_at_few_places_are_no_line_of_a_cogging(
    make_chain: Callable[..., RigidBody], play_twice: Play, law: Callable[[Array], Array], stands: bool
) -> None:
    """Though each of many explains far more than chance would; the lines of a spectrum stand out of each other."""
    body = make_chain("rr")
    evidence = gather(body, play_twice(body, lambda q, dq: law(q), noise=0.1), 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds)
    gains, admission = scores.gains([]), Admission(scores)
    coggings = [
        k
        for k in range(len(scores.owner))
        if (h := scores.hypothesis(k)).effect.name == "cogging" and h.place.joint == 0
    ]
    best = max(coggings, key=lambda k: gains[k])
    assert scores.chance.excluded(int(scores.owner[best]), float(gains[best]), 0.002)
    assert admission.stands_out(best, []) == stands
    told, _ = without_menders(evidence, scores, [best], fitted(evidence, scores, [best]))
    assert [cause.candidate for cause in told] == [best] * stands


@pytest.mark.parametrize("order", [120.0, 160.5])
def test_a_line_above_the_orders_that_are_tried_first_is_named(
    make_chain: Callable[..., RigidBody], play_twice: Play, order: float
) -> None:
    """As of a harmonic drive: two waves a turn of its wave generator. Where the joint turns fast they are above the
    band, and above what these samples tell."""
    body = make_chain("rr")

    def wave(q: Array, dq: Array) -> Array:
        return FIRST * 0.6 * np.sin(order * q[:, [0]] + 0.5)

    recordings = play_twice(body, wave, seconds=10.0, noise=0.1)
    design = gather(body, recordings, 0.05).design
    highest = max(c.theta[0] for c in design.candidates if design.hypotheses[c.hypothesis].effect.name == "cogging")
    (one,) = diagnose(body, recordings).findings
    assert (one.effect, one.place.joint, one.status) == ("cogging", 0, "named")
    assert one.parameters["order"].value > highest
    for name, true in {"order": order, "amplitude": 0.6, "phase": 0.5}.items():
        told = one.parameters[name]
        assert abs(float(told.value) - true) < 4.0 * float(told.standard_error)


def test_what_a_ripple_is_above_the_band_is_no_error(make_chain: Callable[..., RigidBody], play_twice: Play) -> None:
    """What all playings have in common there is taken for an error that is in the band too, until a line tells it; then
    what it hid is seen beside it."""
    body = make_chain("rr")

    def law(q: Array, dq: Array) -> Array:
        return FIRST * 4.0 * np.sin(100.0 * q[:, [0]]) + np.array([0.2, 0.0]) * dq

    evidence = gather(body, play_twice(body, law, seconds=16.0, noise=0.1), 0.05)
    judged = judge(evidence)
    assert judged.evidence.noise.rms[0] < 0.5 * evidence.noise.rms[0]
    assert [f.effect for f in judged.findings] == ["cogging", "viscous_friction"]
    assert float(judged.findings[0].parameters["amplitude"].value) == pytest.approx(4.0, rel=0.02)
    assert float(judged.findings[1].parameters["coefficient"].value) == pytest.approx(0.2, rel=0.1)


@pytest.mark.parametrize("law", [lambda q: 0.0 * q, pushes])
def test_nothing_but_a_line_stands_out_of_the_spectrum_above(
    make_chain: Callable[..., RigidBody], play_twice: Play, law: Callable[[Array], Array]
) -> None:
    body = make_chain("rr")
    evidence = gather(body, play_twice(body, lambda q, dq: law(q), noise=0.1), 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds)
    assert with_fine_lines(evidence, scores, fitted(evidence, scores, [])) is None


@pytest.mark.parametrize(("amplitude", "named"), [(0.5, True), (3.0, False)])
def test_no_ripple_turns_a_motor_s_torque_over(
    make_chain: Callable[..., RigidBody], play_twice: Play, amplitude: float, named: bool
) -> None:
    """Whatever repeats with an angle and goes with the torque beyond that has another name, or none."""
    body = make_chain("rr")
    recordings = [
        replace(one, tau=one.tau * (1.0 + FIRST * amplitude * np.sin(11.0 * one.q)))
        for one in play_twice(body, noise=0.1)
    ]
    found = diagnose(body, recordings)
    assert any(finding.effect == "torque_ripple" for finding in found.findings) == named
