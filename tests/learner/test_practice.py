"""Practice on the simulated planar arm with hidden friction, ripple and noise; and what must not be learnt."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from learner.certificate import certify
from learner.constrained import TorqueLimits
from learner.error_gain import Tolerance
from learner.inverse_model import DecoupledModel
from learner.kinematics import Kinematics
from learner.local_model import LocalModel, States
from learner.operators import ModelOperator, ProportionalOperator
from learner.practice import Practice, Task, prepare
from learner.trial import Reference

Array = NDArray[np.float64]
PERIOD = 2e-3
START, END, DURATION = (0.0, 90.0), (90.0, 17.0), 1.0
HIDDEN = {
    "coulomb": (0.8, 0.3),
    "ripple": 0.03,
    "torque_noise": 0.1,
    "velocity_noise": 1e-3,
}
LIMITS = TorqueLimits(
    np.array([200.0, 100.0]), np.array([2e4, 2e4]), np.array([[-4.0, 4.0], [-4.0, 4.0]]), np.array([20.0, 20.0])
)
NAMES = ("joint1", "joint2")


def task_of(arm: Any, model: Any, reference: Reference) -> Task:
    kinematics = Kinematics(PERIOD, held=True, flat_hz=80.0)
    operator = ModelOperator(model, kinematics)
    certificate = certify(model, reference, arm.loop, operator, Tolerance(0.1, 1e-3))
    return prepare(model, model, reference, kinematics, operator, certificate, arm.loop, arm.timing, LIMITS)


def replays(arm: Any, task: Task, count: int = 5) -> list[Any]:
    return [arm.play(task.reference, task.timing.command(task.base)) for _ in range(count)]


@pytest.fixture
def arm(planar_arm: Any) -> Any:
    return planar_arm(PERIOD, 4.0, **HIDDEN)


@pytest.fixture
def reference(motion: Any) -> Reference:
    made: Reference = motion(START, END, DURATION, PERIOD, 40)
    return made


def test_practice_reaches_repeatability_and_carries_over(
    arm: Any, planar_model: Any, reference: Reference, motion: Any
) -> None:
    task = task_of(arm, planar_model, reference)
    practice = Practice(task, replays(arm, task))
    for _ in range(6):
        practice.take(arm.play(reference, practice.command), NAMES)
    ratios = np.array([x.velocity_error_rms / practice.repeatability.velocity for x in practice.lessons])
    assert ratios[0].max() > 2.0
    assert ratios[1:4].max(axis=1).min() < 1.15
    assert ratios[4:].mean() < 1.1
    assert (ratios[1:] < ratios[0]).all()
    assert not any(x.findings for x in practice.lessons[2:])
    predicted = np.array([x.predicted_rms for x in practice.lessons[2:]])
    np.testing.assert_allclose(predicted, ratios[2:] * practice.repeatability.velocity, rtol=0.3)
    carried_over(arm, planar_model, practice, motion)


class NamedEffects:
    """The rigid bodies with friction and ripple, each fitted to what practice added: effects first (Section 7.1)."""

    def __init__(self, model: Any, reference: Reference, correction: Array) -> None:
        self._model = model
        rigid = model.torque(reference.q, reference.dq, reference.ddq)
        self._values = [
            np.linalg.lstsq(self._columns(reference.q[:, k], reference.dq[:, k], rigid[:, k]), column, rcond=None)[0]
            for k, column in enumerate(correction.T)
        ]

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        rigid = self._model.torque(q, dq, ddq)
        added = [self._columns(q[:, k], dq[:, k], rigid[:, k]) @ value for k, value in enumerate(self._values)]
        return np.asarray(rigid + np.column_stack(added))

    @staticmethod
    def _columns(q: Array, dq: Array, tau: Array) -> Array:
        return np.column_stack([np.tanh(dq / 0.05), tau * np.sin(30 * q), tau * np.cos(30 * q)])


def carried_over(arm: Any, model: Any, practice: Practice, motion: Any) -> None:
    """Section 7.1: nearby motions begin near repeatability, far ones no worse than by the model alone."""
    r = practice.task.reference
    part = Reference(r.q[r.moving], r.dq[r.moving], r.ddq[r.moving], PERIOD, slice(0, r.samples))
    named = NamedEffects(model, part, (practice.torque - practice.task.base)[r.moving])
    local = LocalModel(States(r.q, r.dq, r.ddq), practice.torque - task_of(arm, named, r).base)
    moved = np.rad2deg(0.1)
    near = [
        motion((moved, 90.0 - moved), (90.0 + moved, 17.0 - moved), DURATION, PERIOD, 40),
        motion(START, END, 0.8 * DURATION, PERIOD, 40),
        motion(START, END, 1.2 * DURATION, PERIOD, 40),
    ]
    far = [motion(END, START, DURATION, PERIOD, 40), motion((-60.0, -20.0), (10.0, -90.0), DURATION, PERIOD, 40)]
    for is_far, reference in [(False, x) for x in near] + [(True, x) for x in far]:
        base = task_of(arm, named, reference).base
        correction, trust = local.correction_at(States(reference.q, reference.dq, reference.ddq))
        alone, helped = (
            np.mean(
                [arm.play(reference, arm.timing.command(u)).velocity_error_rms(reference) for _ in range(3)], axis=0
            )
            for u in (base, base + correction)
        )
        assert (helped < 1.05 * alone).all()
        if is_far:
            assert trust[reference.moving].mean() < 0.4
        else:
            assert (helped < 1.2 * practice.repeatability.velocity).all()


def test_a_changed_load_is_noticed_and_not_learnt(arm: Any, planar_model: Any, reference: Reference) -> None:
    task = task_of(arm, planar_model, reference)
    practice = Practice(task, replays(arm, task))
    practice.take(arm.play(reference, practice.command), NAMES)
    before = practice.command.copy()
    arm.tip_mass = 0.15
    lesson = practice.take(arm.play(reference, practice.command), NAMES)
    assert not lesson.learnt
    assert practice.changed_in_a_row == 1
    assert "load changed" in lesson.findings[0]
    np.testing.assert_array_equal(practice.command, before)
    arm.tip_mass = 0.0
    assert practice.take(arm.play(reference, practice.command), NAMES).learnt
    assert practice.changed_in_a_row == 0


def test_where_a_joint_lets_go_says_nothing_of_another_arm(arm: Any, planar_model: Any, reference: Reference) -> None:
    """A torque that differs while the joints creep, as stuck ones' does, and then one that differs on the way."""
    task = task_of(arm, planar_model, reference)
    practice = Practice(task, replays(arm, task))
    practice.take(arm.play(reference, practice.command), NAMES)
    speed = np.abs(reference.dq) / np.abs(reference.dq).max(axis=0)
    for odd, learnt in ((speed < 0.03, True), (speed > 0.5, False)):
        trial = arm.play(reference, practice.command)
        lesson = practice.take(replace(trial, tau=trial.tau + 3.0 * (odd & (reference.dq != 0.0))), NAMES)
        assert lesson.learnt is learnt


def test_the_best_lesson_is_no_later_one_that_is_worse(arm: Any, planar_model: Any, reference: Reference) -> None:
    task = task_of(arm, planar_model, reference)
    practice = Practice(task, replays(arm, task))
    assert practice.best == 0
    practice.take(arm.play(reference, practice.command), NAMES)
    assert practice.best == 1
    practice.take(arm.play(reference, task.base), NAMES)
    assert practice.best == 1


def test_the_hand_picked_filter_plays_noise_back(arm: Any, planar_model: Any, reference: Reference) -> None:
    """Gain one over the whole band: a floor well above repeatability, where the trial filter goes below it."""
    task = task_of(arm, planar_model, reference)
    given = replays(arm, task)
    ends = []
    for hand_picked in (None, 80.0):
        practice = Practice(task, given, hand_picked)
        for _ in range(5):
            practice.take(arm.play(reference, practice.command), NAMES)
        last = [x.velocity_error_rms / practice.repeatability.velocity for x in practice.lessons[-3:]]
        ends.append(float(np.mean(last)))
    assert ends[0] < 1.1
    assert ends[1] > ends[0] + 0.1


def test_what_is_refused(arm: Any, planar_model: Any, reference: Reference) -> None:
    task = task_of(arm, planar_model, reference)
    given = replays(arm, task)
    with pytest.raises(InputError, match="measured on 4 replays"):
        Practice(task, given[:4])
    cut = replace(given[0], q=given[0].q[:-100], dq=given[0].dq[:-100], tau=given[0].tau[:-100])
    with pytest.raises(InputError, match=r"replay 5: q has .* samples of the motion's"):
        Practice(task, [*given[:4], cut])
    holed = given[0].q.copy()
    holed[200, 1] = np.nan
    practice = Practice(task, given)
    before = practice.command.copy()
    with pytest.raises(InputError, match=r"joint number 2 is missing at 0\.400 s"):
        practice.take(replace(given[0], q=holed), NAMES)
    np.testing.assert_array_equal(practice.command, before)
    slow_servo = replace(arm.loop, stiffness=arm.loop.stiffness / 16, damping=arm.loop.damping / 4)
    decoupled = ModelOperator(DecoupledModel(np.array([5 / 3, 1 / 3])), Kinematics(PERIOD, held=True, flat_hz=None))
    refused = certify(planar_model, reference, slow_servo, decoupled)
    with pytest.raises(InputError, match="Hz"):
        prepare(
            planar_model,
            planar_model,
            reference,
            decoupled.kinematics,
            decoupled,
            refused,
            slow_servo,
            arm.timing,
            LIMITS,
        )


def test_feedback_replayed_is_a_proportional_operator(arm: Any, planar_model: Any, reference: Reference) -> None:
    """u_ff + share·feedback, however it is written."""
    operator = ProportionalOperator(arm.loop, share=0.5)
    task = task_of(arm, planar_model, reference)
    trial = arm.play(reference, task.timing.command(task.base))
    error = np.hstack([trial.q - reference.q, trial.dq - reference.dq])
    feedback = -error @ arm.loop.gains.T
    np.testing.assert_allclose(-operator.command_error(trial, reference), -0.5 * feedback, atol=1e-12)
