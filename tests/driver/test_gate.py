"""The gate: whatever is commanded, nothing outside the limits passes, and what is inside is not refused."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config import load_installation
from driver.cyclic.cycle import LoopState
from driver.cyclic.gate import COMMANDING, OVERSPEED, OVERTRAVEL_RAD, Gate

DDA = load_installation("dda")
N = len(DDA.joint)
LIMITS = [joint.limits for joint in DDA.joint]
PERIOD = 1.0 / DDA.cycle.rate_hz
MIDDLE = [sum(limits.position_rad) / 2 for limits in LIMITS]
ZERO = [0.0] * N
ENABLE = [0x0F] * N
OFF = [0x00] * N
ROUNDING = 1.001

anything = st.floats(allow_nan=True, allow_infinity=True)
near = st.floats(-1.5, 1.5)


def gate_at(q: list[float] = MIDDLE, tau: list[float] = ZERO) -> Gate:
    gate = Gate(DDA)
    assert gate.check(LoopState.IDLE, OFF, q, ZERO, tau, q, ZERO, [0] * N, position_is_sent=True) is None
    return gate


def passes(gate: Gate, state: LoopState, q_d: list[float], dq_d: list[float], tau: list[float], **rest: object) -> bool:
    given = {"q": q_d, "dq": dq_d, "age": [0] * N, "position_is_sent": True} | rest
    return gate.check(state, ENABLE, q_d, dq_d, tau, **given) is None  # type: ignore[arg-type]


@settings(max_examples=300, deadline=None)
@given(
    state=st.sampled_from(sorted(COMMANDING)),
    steps=st.lists(
        st.tuples(*(st.lists(st.one_of(near, anything), min_size=N, max_size=N) for _ in range(3))),
        min_size=1,
        max_size=6,
    ),
)
def test_nothing_outside_the_limits_ever_passes(
    state: LoopState, steps: list[tuple[list[float], list[float], list[float]]]
) -> None:
    gate = gate_at()
    last_q, last_tau = MIDDLE, ZERO
    for share_q, share_dq, share_tau in steps:
        # Shares of what one cycle allows: most commands fall near the limits, where mistakes live.
        q_d = [q + s * limits.velocity_rad_s * PERIOD for q, s, limits in zip(last_q, share_q, LIMITS, strict=True)]
        dq_d = [s * limits.velocity_rad_s for s, limits in zip(share_dq, LIMITS, strict=True)]
        tau = [
            t + s * limits.torque_rate_nm_s * PERIOD for t, s, limits in zip(last_tau, share_tau, LIMITS, strict=True)
        ]
        if not passes(gate, state, q_d, dq_d, tau, q=MIDDLE, dq=ZERO):
            continue
        for i, limits in enumerate(LIMITS):
            low, high = limits.position_rad
            assert math.isfinite(q_d[i]) and math.isfinite(dq_d[i]) and math.isfinite(tau[i])
            assert low - 1e-6 <= q_d[i] <= high + 1e-6
            assert abs(dq_d[i]) <= limits.velocity_rad_s * ROUNDING
            assert abs(tau[i]) <= limits.torque_nm * ROUNDING
            assert abs(q_d[i] - last_q[i]) <= limits.velocity_rad_s * PERIOD * ROUNDING
            assert abs(tau[i] - last_tau[i]) <= limits.torque_rate_nm_s * PERIOD * ROUNDING
        last_q, last_tau = q_d, tau


@settings(max_examples=100, deadline=None)
@given(
    seconds=st.floats(0.05, 0.5),
    share=st.lists(st.floats(-0.99, 0.99), min_size=N, max_size=N),
)
def test_what_keeps_the_limits_is_never_refused(seconds: float, share: list[float]) -> None:
    gate = gate_at()
    cycles = round(seconds / PERIOD)
    path = [
        [
            mid + s * min(limits.velocity_rad_s * PERIOD * k, 0.5 * (limits.position_rad[1] - limits.position_rad[0]))
            for mid, s, limits in zip(MIDDLE, share, LIMITS, strict=True)
        ]
        for k in range(cycles)
    ]
    dq_d = [s * limits.velocity_rad_s for s, limits in zip(share, LIMITS, strict=True)]
    torque = [
        [
            s * min(limits.torque_nm, limits.torque_rate_nm_s * PERIOD * k)
            for s, limits in zip(share, LIMITS, strict=True)
        ]
        for k in range(cycles)
    ]
    for q_d, tau in zip(path, torque, strict=True):
        assert passes(gate, LoopState.PLAYING, q_d, dq_d, tau, q=MIDDLE, dq=ZERO)


@pytest.mark.parametrize("state", [s for s in LoopState if s not in COMMANDING])
@given(words=st.lists(st.integers(0, 0xFFFF), min_size=N, max_size=N))
def test_no_drive_is_enabled_in_a_state_that_commands_nothing(state: LoopState, words: list[int]) -> None:
    refusal = Gate(DDA).check(state, words, MIDDLE, ZERO, ZERO, MIDDLE, ZERO, [0] * N, position_is_sent=True)
    assert (refusal is None) is not any(word & 0x0F == 0x0F for word in words)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("joint", range(N))
def test_a_refused_command_says_which_joint_and_what(joint: int, value: float) -> None:
    bad = [value if i == joint else 0.0 for i in range(N)]
    refusal = gate_at().check(
        LoopState.HOLDING, ENABLE, MIDDLE, ZERO, bad, MIDDLE, ZERO, [0] * N, position_is_sent=False
    )
    assert refusal is not None
    assert refusal.joint == DDA.joint[joint].name and "torque" in str(refusal)
    over = [q + (LIMITS[i].velocity_rad_s * PERIOD * 2 if i == joint else 0) for i, q in enumerate(MIDDLE)]
    refusal = gate_at().check(LoopState.PLAYING, ENABLE, over, ZERO, ZERO, MIDDLE, ZERO, [0] * N, position_is_sent=True)
    assert refusal is not None and refusal.joint == DDA.joint[joint].name
    excess = LIMITS[joint].velocity_rad_s * PERIOD
    assert abs(abs(refusal.value - refusal.limit) - excess) < 1e-4 * excess
    assert f"{excess:.2g}"[:3] in str(refusal)


def test_a_refused_command_is_not_remembered_as_sent() -> None:
    gate = gate_at()
    step = [limits.velocity_rad_s * PERIOD for limits in LIMITS]
    assert not passes(gate, LoopState.PLAYING, [q + 3 * s for q, s in zip(MIDDLE, step, strict=True)], ZERO, ZERO)
    assert not passes(gate, LoopState.PLAYING, [q + 2 * s for q, s in zip(MIDDLE, step, strict=True)], ZERO, ZERO)
    assert passes(gate, LoopState.PLAYING, [q + s for q, s in zip(MIDDLE, step, strict=True)], ZERO, ZERO)


@pytest.mark.parametrize("state", [LoopState.ENABLING, LoopState.HOLDING, LoopState.PLAYING])
def test_old_feedback_and_a_runaway_joint_are_refused_except_while_stopping(state: LoopState) -> None:
    limit = DDA.cycle.missed_deadlines_to_stop
    fast = [OVERSPEED * LIMITS[0].velocity_rad_s * 1.01, 0.0, 0.0]
    far = [LIMITS[0].position_rad[1] + OVERTRAVEL_RAD * 1.01, *MIDDLE[1:]]
    nan = [math.nan, *MIDDLE[1:]]
    for rest in ({"dq": fast, "q": MIDDLE}, {"q": far}, {"q": nan}, {"age": [limit + 1, 0, 0], "q": nan}):
        assert not passes(gate_at(), state, MIDDLE, ZERO, ZERO, **rest)
        assert passes(gate_at(), LoopState.STOPPING, MIDDLE, ZERO, ZERO, **rest)
    assert passes(gate_at(), state, MIDDLE, ZERO, ZERO, q=nan, age=[limit, 0, 0])


def test_a_slower_controller_may_step_by_what_its_period_allows() -> None:
    interval = 7.5 * PERIOD
    step = [0.9 * limits.torque_rate_nm_s * interval for limits in LIMITS]
    small = [min(s, 0.9 * limits.torque_nm) for s, limits in zip(step, LIMITS, strict=True)]
    assert any(s > limits.torque_rate_nm_s * PERIOD for s, limits in zip(small, LIMITS, strict=True))
    assert not passes(gate_at(), LoopState.PLAYING, MIDDLE, ZERO, small)
    assert passes(gate_at(), LoopState.PLAYING, MIDDLE, ZERO, small, torque_interval_s=interval)
