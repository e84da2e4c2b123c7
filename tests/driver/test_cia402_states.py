"""The 402 state machine: decoding over all statuswords, and controlwords over all pairs of states."""

from __future__ import annotations

import pytest

from driver.cia402.states import (
    TARGETS,
    Control,
    State,
    controlword_towards,
    describe_statusword,
    next_state,
    path,
    state_of,
)

# IEC 61800-7-201, table of states: statusword bits 6, 5, 3, 2, 1, 0 ("x" is any).
TABLE = {
    "0x0000": State.NOT_READY,
    "1x0000": State.SWITCH_ON_DISABLED,
    "010001": State.READY,
    "010011": State.SWITCHED_ON,
    "010111": State.OPERATION_ENABLED,
    "000111": State.QUICK_STOP_ACTIVE,
    "0x1111": State.FAULT_REACTION_ACTIVE,
    "0x1000": State.FAULT,
}


def expected(statusword: int) -> State | None:
    bits = "".join(str(statusword >> bit & 1) for bit in (6, 5, 3, 2, 1, 0))
    matches = [s for pattern, s in TABLE.items() if all(p in ("x", b) for p, b in zip(pattern, bits, strict=True))]
    assert len(matches) < 2
    return matches[0] if matches else None


def test_every_statusword() -> None:
    for statusword in range(0x10000):
        assert state_of(statusword) is expected(statusword), hex(statusword)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("start", State)
def test_every_target_from_every_state(start: State, target: State) -> None:
    unreachable = start in (State.NOT_READY, State.FAULT_REACTION_ACTIVE, State.FAULT) or (
        target is State.QUICK_STOP_ACTIVE and start not in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
    )
    if unreachable:
        assert controlword_towards(start, target) is None
        with pytest.raises(ValueError, match="no controlword leads"):
            path(start, target)
        return
    steps = path(start, target)
    assert len(steps) <= 4
    reached = steps[-1][1] if steps else start
    assert reached is target
    hold = controlword_towards(target, target)
    assert hold is not None
    assert next_state(target, hold) is target


def test_enabling_takes_the_standards_way() -> None:
    assert path(State.SWITCH_ON_DISABLED, State.OPERATION_ENABLED) == (
        (Control.SHUTDOWN, State.READY),
        (Control.SWITCH_ON, State.SWITCHED_ON),
        (Control.ENABLE_OPERATION, State.OPERATION_ENABLED),
    )


@pytest.mark.parametrize("target", [State.FAULT, State.NOT_READY, State.FAULT_REACTION_ACTIVE])
def test_what_nobody_can_command(target: State) -> None:
    with pytest.raises(ValueError, match="cannot be commanded"):
        controlword_towards(State.READY, target)


@pytest.mark.parametrize("state", State)
def test_torque_only_where_the_power_stage_is_on(state: State) -> None:
    on = {State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE}
    assert state.torque_possible == (state in on)


def test_no_controlword_leads_out_of_a_fault_but_its_reset() -> None:
    for word in range(0x80):
        assert next_state(State.FAULT, word) is State.FAULT
    assert next_state(State.FAULT, Control.FAULT_RESET) is State.SWITCH_ON_DISABLED
    assert next_state(State.FAULT_REACTION_ACTIVE, Control.FAULT_RESET) is State.FAULT_REACTION_ACTIVE


def test_words_for_people() -> None:
    assert describe_statusword(0x1237) == "operation enabled"
    assert describe_statusword(0x0237) == "operation enabled, not following the command"
    assert describe_statusword(0x28B8) == "fault, warning, internal limit active, following error"
    assert describe_statusword(0x0001) == "no state of the standard (0x0001)"
