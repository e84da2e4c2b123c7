"""Practice of a geared joint that sticks: bristle friction, an encoder's counts, a servo without an integrator."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from learner.certificate import certify
from learner.constrained import TorqueLimits
from learner.error_gain import Tolerance
from learner.feedback_loop import FeedbackLoop
from learner.kinematics import Kinematics
from learner.operators import ModelOperator
from learner.practice import Practice, Task, prepare
from learner.trial import Reference, Timing, Trial
from learner.velocity_sensor import as_read, from_angles

Array = NDArray[np.float64]
PERIOD, TICKS = 2e-3, 8
INERTIA, VISCOUS, LEVEL = 0.19, 0.6, 1.2
COUNT = 2.0 * math.pi / 57538
STIFFNESS, DAMPING = 450.0, 14.0
ENCODER_ONLY = np.array([True])


@dataclass
class Joint:
    """LuGre friction with a breakaway level a quarter higher and bristles of 0.8 mrad; the motor's torque is noisy."""

    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(4))
    state: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Angle, speed, deflection of the bristles."""

    def play(self, task: Task, command: Array) -> Trial:
        """Back from the motion's end without feedforward, a rest, and the motion."""
        reference, loop = task.reference, task.loop
        still = np.zeros(50)
        self._follow(reference.q[::-1, 0], -reference.dq[::-1, 0], np.zeros(reference.samples))
        self._follow(still + reference.q[0, 0], still, still)
        q = self._follow(reference.q[:, 0], reference.dq[:, 0], command[:, 0])[:, None]
        raw = Trial(q, reference.dq, np.zeros_like(q))
        told = from_angles(raw, reference, ENCODER_ONLY, task.certificate.band_hz)
        demand = command + loop.stiffness * (reference.q - q) + loop.damping * (reference.dq - told.dq)
        return Trial(q, told.dq, demand)

    def _follow(self, wanted: Array, speed: Array, feedforward: Array) -> Array:
        """Angles as counted at the end of each sample, in which the servo comes to that sample's reference."""
        h, bristle = PERIOD / TICKS, LEVEL / 8e-4
        q, dq, z = self.state
        seen = []
        noise = 0.03 * self.rng.standard_normal(len(wanted))
        for k in range(len(wanted)):
            before = max(k - 1, 0)
            for tick in range(TICKS):
                part = (tick + 1) / TICKS
                angle, rate, push = (x[before] + part * (x[k] - x[before]) for x in (wanted, speed, feedforward))
                tau = STIFFNESS * (angle - COUNT * round(q / COUNT)) + DAMPING * (rate - dq) + push + noise[k]
                level = LEVEL * (1.0 + 0.25 * math.exp(-((abs(dq) / 0.06) ** 1.3)))
                share = level / (level + h * bristle * abs(dq))
                held = share * bristle * z + 2e-3 * bristle * (share - 1.0) * z / h
                rubs = share * bristle * (h + 2e-3) + VISCOUS
                dq = (dq + h / INERTIA * (tau - held)) / (1.0 + h / INERTIA * rubs)
                z = share * (z + h * dq)
                q += h * dq
            seen.append(COUNT * round(q / COUNT))
        self.state = (q, dq, z)
        return np.array(seen)


@dataclass(frozen=True)
class Model:
    """The joint as identification has it: a few per cent off, and friction as a sign that is not sharp."""

    level: float

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return 0.95 * INERTIA * ddq + 0.9 * VISCOUS * dq + self.level * np.tanh(dq / 0.01)


def reference_of(way: float, duration: float) -> Reference:
    u = np.linspace(0.0, 1.0, round(duration / PERIOD) + 1)[:, None]
    q = way * (10 * u**3 - 15 * u**4 + 6 * u**5)
    dq = way / duration * (30 * u**2 - 60 * u**3 + 30 * u**4)
    ddq = way / duration**2 * (60 * u - 180 * u**2 + 120 * u**3)
    return Reference.between_rests(q, dq, ddq, PERIOD, 75, 150)


def practised(command_error_by: Model, trials: int) -> Practice:
    joint, model, sliding = Joint(), Model(1.05 * LEVEL), Model(0.0)
    reference = reference_of(0.7, 1.0)
    loop = FeedbackLoop(np.array([STIFFNESS]), np.array([DAMPING]), PERIOD, 2)
    kinematics = Kinematics(PERIOD, held=True, flat_hz=150.0)
    operator = ModelOperator(command_error_by, kinematics, momentary=sliding)
    certificate = certify(sliding, reference, loop, operator, Tolerance(0.1, 2e-3))
    limits = TorqueLimits(np.array([20.0]), np.array([2000.0]), np.array([[-4.0, 4.0]]), np.array([3.0]))
    timing = Timing(held=True, advance=0.0)
    task = prepare(model, sliding, reference, kinematics, operator, certificate, loop, timing, limits)
    joint.play(task, task.base)
    replays = [joint.play(task, task.base) for _ in range(5)]
    counted = as_read(reference, np.array([COUNT]), ENCODER_ONLY, certificate.band_hz)
    practice = Practice(task, replays, as_read=counted)
    for _ in range(trials):
        practice.take(joint.play(task, practice.command), ["joint"])
    return practice


def ratios(practice: Practice) -> Array:
    return np.array([float(x.velocity_error_rms[0] / practice.repeatability.velocity[0]) for x in practice.lessons])


@pytest.fixture(scope="module")
def practice() -> Practice:
    return practised(Model(0.0), 6)


def test_a_joint_that_sticks_comes_to_its_repeatability(practice: Practice) -> None:
    told = ratios(practice)
    assert told[0] > 2.0
    assert told[1:4].min() < 1.5
    assert told[-1] < 1.2
    assert (told[1:] < told[0]).all()
    peaks = [float(x.position_error_peak[0]) for x in practice.lessons]
    assert peaks[-1] < 0.25 * peaks[0]
    assert not practice.left(["joint"])


def test_what_is_left_is_told_with_its_place() -> None:
    """Before anything was learnt the joint is late where it lets go, and early where it comes to rest."""
    practice = practised(Model(0.0), 0)
    assert practice.lessons[0].slow_share > 0.5
    (sentence,) = practice.left(["joint"])
    assert sentence.startswith("joint 2.")
    assert sentence.endswith("%)")


def test_friction_by_the_measured_speed_drives_a_stuck_joint_too_far(practice: Practice) -> None:
    """Why an operator is told without dry friction: a joint at rest has a torque of its own, and no sign."""
    assert ratios(practised(Model(1.05 * LEVEL), 3))[3] > 1.5 * ratios(practice)[3]


def test_counts_are_part_of_repeatability_though_replays_repeat_them() -> None:
    reference = reference_of(0.7, 1.0)
    counted = as_read(reference, np.array([COUNT]), ENCODER_ONLY, 40.0)
    errors = np.array([x.velocity_error_rms(reference)[0] for x in counted])
    # White counts' errors of variance count²/12, differentiated, up to the band and half its roll-off.
    expected = COUNT / math.sqrt(12.0) * 2.0 * math.pi * math.sqrt(45.0**3 / (3.0 * 0.5 / PERIOD))
    assert math.sqrt(float(np.mean(errors**2))) == pytest.approx(expected, rel=0.25)
    tachometer = as_read(reference, np.array([COUNT]), ~ENCODER_ONLY, 40.0)
    assert all(not (x.q - reference.q).any() and not (x.dq - reference.dq).any() for x in tachometer)
