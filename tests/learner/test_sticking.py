"""What dry friction does to a motion's begin, as told beforehand, against joints that stick, simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from learner.feedback_loop import FeedbackLoop
from learner.sticking import sticking
from learner.trial import Reference

Array = NDArray[np.float64]
PERIOD, TICKS = 2e-3, 20


@dataclass(frozen=True)
class Joint:
    """Inertia J, Coulomb friction F exactly as the model has it, a servo of stiffness K and damping D."""

    inertia: float
    level: float
    stiffness: float
    damping: float

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return self.inertia * ddq + self.level * np.tanh(dq / 1e-3)

    @property
    def loop(self) -> FeedbackLoop:
        return FeedbackLoop(np.array([self.stiffness]), np.array([self.damping]), PERIOD, 2)

    def play(self, reference: Reference, feedforward: Array, q: float) -> tuple[Array, Array]:
        """Angles and speeds (samples,) from rest at ``q``."""
        h, dq = PERIOD / TICKS, 0.0
        seen = []
        for k in range(reference.samples):
            seen.append((q, dq))
            for _ in range(TICKS):
                servo = self.stiffness * (reference.q[k, 0] - q) + self.damping * (reference.dq[k, 0] - dq)
                push = servo + feedforward[k, 0]
                free = dq + h / self.inertia * push
                slowed = h / self.inertia * self.level
                dq = 0.0 if abs(free) <= slowed else free - np.sign(free) * slowed
                q += h * dq
        q_seen, dq_seen = np.array(seen).T
        return q_seen, dq_seen


@dataclass(frozen=True)
class Bodies:
    """The same without dry friction."""

    joint: Joint

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return self.joint.inertia * ddq


def reference_of(way: float, duration: float) -> Reference:
    u = np.linspace(0.0, 1.0, round(duration / PERIOD) + 1)[:, None]
    q = way * (10 * u**3 - 15 * u**4 + 6 * u**5)
    dq = way / duration * (30 * u**2 - 60 * u**3 + 30 * u**4)
    ddq = way / duration**2 * (60 * u - 180 * u**2 + 120 * u**3)
    return Reference.between_rests(q, dq, ddq, PERIOD, 75, 150)


def joints() -> list[Joint]:
    """As light, stiff and overdamped as geared joints under servos without integrators are."""
    rng = np.random.default_rng(5)
    made = []
    for _ in range(4):
        stiffness = float(np.exp(rng.uniform(np.log(100.0), np.log(3000.0))))
        damping = stiffness * rng.uniform(0.03, 0.06)
        inertia = damping * rng.uniform(0.006, 0.012)
        made.append(Joint(inertia, stiffness * rng.uniform(1e-3, 4e-3), stiffness, damping))
    return made


@pytest.mark.parametrize("joint", joints())
@pytest.mark.parametrize("way", [1.2, -0.8])
def test_a_joint_sticks_as_far_and_as_long_as_told_and_costs_as_much(joint: Joint, way: float) -> None:
    reference = reference_of(way, 1.25)
    told = sticking(joint, Bodies(joint), reference, joint.loop)
    start = reference.moving.start
    assert told.friction == pytest.approx(joint.level, rel=1e-3)
    # Its servo brings it to the edge of the band and no farther.
    band = float(told.band[0])
    still = np.zeros((500, 1))
    rest = Reference(still, still, still, PERIOD, slice(0, 500))
    came, _ = joint.play(rest, still, np.sign(way) * 4.0 * band)
    assert abs(came[-1]) == pytest.approx(band, rel=0.02)
    # It comes back from the motion's end: the far side is the one ahead of the motion.
    feedforward = joint.torque(reference.q, reference.dq, reference.ddq)
    _, dq = joint.play(reference, feedforward, np.sign(way) * 0.999 * band)
    begun = int(np.flatnonzero(np.abs(dq) > 0.0)[0]) - start
    assert begun * PERIOD == pytest.approx(told.held[0], abs=2.5 * PERIOD)
    error = (dq[:, None] - reference.dq)[reference.moving]
    # What the servo takes back by itself, and a part for the time in which the motion went on without the joint.
    assert 1.0 < float(np.sqrt(np.mean(error**2)) / told.velocity_error[0]) < 1.5


def test_a_joint_without_friction_or_motion_sticks_nowhere() -> None:
    joint = joints()[0]
    smooth = sticking(Bodies(joint), Bodies(joint), reference_of(1.2, 1.25), joint.loop)
    still = sticking(joint, Bodies(joint), reference_of(0.0, 1.25), joint.loop)
    for told in (smooth, still):
        assert not any(x.any() for x in (told.friction, told.band, told.held, told.velocity_error))


def test_a_joint_that_never_lets_go_is_held_throughout() -> None:
    joint = joints()[0]
    stuck = Joint(joint.inertia, 50.0 * joint.level, joint.stiffness, joint.damping)
    reference = reference_of(1e-3 * joint.level / joint.stiffness, 1.25)
    told = sticking(stuck, Bodies(joint), reference, joint.loop)
    assert told.held == pytest.approx((reference.moving.stop - reference.moving.start) * PERIOD)
