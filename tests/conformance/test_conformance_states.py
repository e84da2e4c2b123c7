"""Every state of the CiA 402 state machine × every command of the controlword."""

from __future__ import annotations

from typing import Any

import pytest

from driver.cia402.states import Control, State, next_state

STATES = (
    State.SWITCH_ON_DISABLED,
    State.READY,
    State.SWITCHED_ON,
    State.OPERATION_ENABLED,
    State.QUICK_STOP_ACTIVE,
    State.FAULT,
)
CONTROLWORDS = (*range(0x10), 0x80, 0x86, 0x8F, 0x100, 0x10F, 0x1F0)


def settled(state: State, controlword: int) -> set[State]:
    """Where the standard lets a held controlword lead: single steps repeated; transition 16 is optional."""
    reached = state
    while (following := next_state(reached, controlword)) is not reached:
        # A fault reset acts at its edge once; what it leads to is then commanded by the other bits.
        reached = following
    either = {reached}
    if state is State.QUICK_STOP_ACTIVE and reached is State.OPERATION_ENABLED:
        either.add(State.QUICK_STOP_ACTIVE)
    return either


@pytest.mark.parametrize("controlword", CONTROLWORDS, ids=lambda word: f"{word:03X}")
@pytest.mark.parametrize("state", STATES, ids=lambda state: state.name)
def test_transition(bench: Any, state: State, controlword: int) -> None:
    bench.go(state)
    if state is State.FAULT:
        bench.run(3, Control.DISABLE_VOLTAGE)  # So that bit 7 rises.
    assert bench.settle(controlword) in settled(state, controlword)


def test_enabling_step_by_step(bench: Any) -> None:
    assert bench.settle(Control.SHUTDOWN) is State.READY
    assert bench.settle(Control.SWITCH_ON) is State.SWITCHED_ON
    assert bench.settle(Control.ENABLE_OPERATION, 200) is State.OPERATION_ENABLED
    assert bench.settle(Control.SWITCH_ON, 200) is State.SWITCHED_ON
    assert bench.settle(Control.SHUTDOWN) is State.READY
    assert bench.settle(Control.DISABLE_VOLTAGE) is State.SWITCH_ON_DISABLED


def test_a_fault_reset_that_was_set_before_the_fault_is_no_edge(bench: Any) -> None:
    bench.run(5, Control.FAULT_RESET)
    bench.run(100)
    assert bench.state() is State.FAULT
    assert bench.settle(Control.FAULT_RESET) is State.FAULT
    bench.run(3, Control.DISABLE_VOLTAGE)
    assert bench.settle(Control.FAULT_RESET) is State.SWITCH_ON_DISABLED


def test_a_fault_ends_every_torque(bench: Any) -> None:
    bench.go(State.OPERATION_ENABLED)
    bench.run(200)  # The fault reaction, which may ramp down first.
    assert bench.state() is State.FAULT


def test_enabling_after_a_fault_starts_at_the_beginning(bench: Any) -> None:
    bench.go(State.FAULT)
    bench.run(3, Control.DISABLE_VOLTAGE)
    bench.run(3, Control.FAULT_RESET)
    assert bench.settle(Control.ENABLE_OPERATION) is State.SWITCH_ON_DISABLED
