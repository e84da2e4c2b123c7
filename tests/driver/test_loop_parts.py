"""Parts of the loop by themselves: references, controllers, the damped stop, an axis' sequencing, plans in memory."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config import load_installation
from driver.cia402.pdo import Feedback
from driver.cia402.pdo_input import Reception
from driver.cia402.states import Control, State, next_state
from driver.cyclic.axis import RESET_TIMEOUT_NS, STEP_TIMEOUT_NS, Axis
from driver.cyclic.controller import TorqueController
from driver.cyclic.damping import DampedStop
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.messages import plan_from_memory, plan_to_memory
from driver.cyclic.reference import Desired, Hold, SlowDown
from driver.cyclic.supervision import Supervision
from driver.gravity import RigidBody
from driver.plan import Plan

DDA = load_installation("dda")
BODY = RigidBody(DDA)
N = len(DDA.joint)
ZEROS = [0.0] * N
MS = 1_000_000
STATUSWORDS = {
    State.SWITCH_ON_DISABLED: 0x0250,
    State.READY: 0x0231,
    State.SWITCHED_ON: 0x0233,
    State.OPERATION_ENABLED: 0x1237,
    State.QUICK_STOP_ACTIVE: 0x0217,
    State.FAULT: 0x0218,
}


def quintic(by: list[float], seconds: float) -> Plan:
    s = np.linspace(0.0, 1.0, round(seconds * 1000))[:, None]
    start = np.array([sum(j.limits.position_rad) / 2 for j in DDA.joint]) - np.array(by) / 2
    return Plan(
        q=start + (10 * s**3 - 15 * s**4 + 6 * s**5) * by,
        dq=(30 * s**2 - 60 * s**3 + 30 * s**4) * np.array(by) / seconds,
        ddq=(60 * s - 180 * s**2 + 120 * s**3) * np.array(by) / seconds**2,
    )


@settings(max_examples=60, deadline=None)
@given(
    by=st.lists(st.floats(-1.5, 1.5), min_size=N, max_size=N),
    seconds=st.floats(0.9, 2.0),
    share=st.floats(0.0, 1.0),
)
def test_slowing_down_stays_on_the_path_and_never_exceeds_the_plans_speed(
    by: list[float], seconds: float, share: float
) -> None:
    plan = quintic(by, seconds)
    sample = max(1, round(share * plan.samples))
    slow = SlowDown(plan, sample, DDA, ZEROS)
    slow.rest_torque = [1.0] * N
    track = [Desired(*(a[sample - 1].tolist() for a in plan.arrays))]
    while not slow.done:
        track.append(slow.next())
    rest = slow.next()
    assert rest.dq == pytest.approx(ZEROS, abs=1e-12)
    assert rest.q == pytest.approx(track[-1].q, abs=1e-9)
    assert rest.tau_ff == [1.0] * N
    fastest = np.abs(plan.arrays[1]).max(axis=0)
    for before, after in pairwise(track):
        step = np.abs(np.array(after.q) - np.array(before.q))
        assert (step <= fastest * 1e-3 * 1.01 + 1e-12).all()
        assert (np.abs(after.dq) <= fastest + 1e-12).all()
    # On the path: all joints have come the same share of their way.
    moved = np.array([d.q for d in track]) - plan.arrays[0][0]
    longest = int(np.argmax(np.abs(by)))
    if abs(by[longest]) > 0.1:
        expected = moved[:, [longest]] * (np.array(by) / by[longest])
        assert np.allclose(moved, expected, atol=1e-9)


def test_holding_changes_its_torque_smoothly_and_completely() -> None:
    hold = Hold([1.0] * N, ZEROS, [50.0] * N, 1e-3)
    torque = [hold.next().tau_ff[0] for _ in range(120)]
    assert hold.done and torque[-1] == 50.0
    assert max(b - a for a, b in pairwise([0.0, *torque])) < 50.0 * 1.6 / 100
    assert all(b >= a for a, b in pairwise(torque))


def test_a_joint_without_feedback_keeps_its_torque_and_spoils_no_other() -> None:
    desired = Desired([3.0, 2.0, 1.0], ZEROS, ZEROS, [5.0, 5.0, 5.0])
    q, dq = [3.01, math.nan, 1.0], [0.0, math.nan, 0.1]
    for kind in ("pd", "pd+ff", "computed_torque"):
        controller = TorqueController(DDA, "cst", kind, None, BODY)  # type: ignore[arg-type]
        tau, ff = controller.torque(desired, q, dq, [True, False, True], [0.0, 7.0, 0.0])
        assert tau[1] == 7.0
        assert all(map(math.isfinite, tau + ff))
        gains = DDA.joint[0].digital
        assert tau[0] == pytest.approx(-0.01 * gains.stiffness_nm_rad + ff[0])


@settings(max_examples=100, deadline=None)
@given(
    dq=st.lists(st.floats(-20, 20), min_size=N, max_size=N),
    last=st.lists(st.floats(-1, 1), min_size=N, max_size=N),
    valid=st.lists(st.booleans(), min_size=N, max_size=N),
)
def test_the_damped_stop_keeps_the_limits_itself(dq: list[float], last: list[float], valid: list[bool]) -> None:
    limits = [joint.limits for joint in DDA.joint]
    before = [share * limit.torque_nm for share, limit in zip(last, limits, strict=True)]
    seen = [v if ok else math.nan for v, ok in zip(dq, valid, strict=True)]
    tau = DampedStop(DDA, BODY).torque(list(DDA.arm.home_rad), seen, valid, before)
    for i, limit in enumerate(limits):
        assert abs(tau[i]) <= limit.torque_nm
        assert abs(tau[i] - before[i]) <= limit.torque_rate_nm_s / DDA.cycle.rate_hz * (1 + 1e-9)
        if not valid[i]:
            assert tau[i] == before[i]


def test_gravity_is_inverse_dynamics_at_rest() -> None:
    q = [2.0, 1.0, 0.5]
    assert BODY.gravity(q) == pytest.approx(BODY.inverse_dynamics(q, ZEROS, ZEROS))
    assert max(map(abs, BODY.gravity(q))) > 0.1


@given(start=st.sampled_from([s for s in STATUSWORDS if s is not State.FAULT]))
def test_an_axis_is_led_to_operation_and_back_from_wherever_it_is(start: State) -> None:
    axis, state, now = Axis("joint1"), start, 0
    for ask, target in ((axis.enable, State.OPERATION_ENABLED), (axis.disable, State.SWITCH_ON_DISABLED)):
        ask()
        for _ in range(8):
            state = next_state(state, axis.step(STATUSWORDS[state], now))
            now += MS
        assert state is target and axis.reached and axis.cause is None


def test_an_axis_in_fault_is_not_enabled_without_a_reset_by_an_edge() -> None:
    axis, now = Axis("joint1"), 0
    axis.enable()
    assert axis.step(STATUSWORDS[State.FAULT], now) == Control.DISABLE_VOLTAGE
    assert axis.cause is not None and "fault" in axis.cause
    axis.reset_fault()
    words = []
    for _ in range(60):
        now += MS
        words.append(axis.step(STATUSWORDS[State.FAULT], now))
    assert (Control.DISABLE_VOLTAGE, Control.FAULT_RESET) in set(pairwise(words))
    axis.step(STATUSWORDS[State.FAULT], now + 2 * RESET_TIMEOUT_NS)
    assert axis.cause is not None and "does not leave its fault" in axis.cause


def test_an_axis_that_leaves_operation_stays_out_and_one_that_is_stuck_is_named() -> None:
    axis = Axis("joint1")
    axis.enable()
    axis.step(STATUSWORDS[State.OPERATION_ENABLED], 0)
    for k in range(5):
        word = axis.step(STATUSWORDS[State.SWITCH_ON_DISABLED], k * MS)
        assert word == Control.DISABLE_VOLTAGE
    assert axis.cause is not None and "left operation by itself" in axis.cause
    stuck = Axis("joint2")
    stuck.enable()
    stuck.step(STATUSWORDS[State.READY], 0)
    stuck.step(STATUSWORDS[State.READY], STEP_TIMEOUT_NS + MS)
    assert stuck.cause is not None and "joint2: the drive stays in ready to switch on" in stuck.cause


def test_missing_feedback_ages_and_is_never_repeated() -> None:
    feedback = ArmFeedback(2)
    good = Feedback([True, True], [0x1237, 0x1237], [1.0, 2.0], [0.1, 0.2], [3.0, 4.0])
    nan = math.nan
    half = Feedback([True, False], [0x1237, -1], [1.1, nan], [0.1, nan], [3.0, nan])
    feedback.take(good, 1)
    feedback.take(good, 2)
    assert feedback.complete and feedback.unchanged
    for age in (1, 2, 3):
        feedback.take(half, 2 + age)
        assert feedback.age == [0, age] and not feedback.complete and not feedback.unchanged
        assert math.isnan(feedback.q[1]) and feedback.states == [State.OPERATION_ENABLED, None]
        assert feedback.q_known == [1.1, 2.0]
    feedback.take(good, 9)
    assert feedback.age == [0, 0] and feedback.complete and not feedback.unchanged


def test_a_plan_survives_its_way_through_memory() -> None:
    plan = quintic([1.0, -1.0, 0.5], 1.0)
    plan = Plan(*plan.arrays, mode="cst", controller="pd", controller_rate_hz=133.0, urdf="<robot/>", name="ä")
    again = plan_from_memory(*plan_to_memory(plan))
    for a, b in zip(plan.arrays, again.arrays, strict=True):
        assert np.array_equal(a, b)
    for name in ("mode", "controller", "controller_rate_hz", "urdf", "name"):
        assert getattr(again, name) == getattr(plan, name)


def test_a_drive_that_was_in_fault_before_anybody_listened_is_told_with_its_error() -> None:
    """Its emergency was sent while it was set up; the reason is what it said then, of this fault alone."""
    supervision, feedback = Supervision(DDA), ArmFeedback(N)
    supervision.forget({"joint2": "fault: over-voltage of the DC link (3210)"})

    def causes(state: State) -> list[str]:
        words = [STATUSWORDS[State.SWITCHED_ON], STATUSWORDS[state], STATUSWORDS[State.SWITCHED_ON]]
        feedback.take(Feedback([True] * N, words, ZEROS, ZEROS, ZEROS), 0)
        return supervision.look(Reception(), feedback, [], punctual=True, commanding=False).causes

    assert causes(State.FAULT) == ["joint2: the drive reports fault: over-voltage of the DC link (3210)"]
    assert causes(State.FAULT) == []
    assert causes(State.SWITCHED_ON) == []
    assert causes(State.FAULT) == ["joint2: the drive reports fault"]
    supervision.forget({"joint2": "fault: over-voltage of the DC link (3210)"})
    assert causes(State.SWITCHED_ON) == []
    assert causes(State.FAULT) == ["joint2: the drive reports fault"]
