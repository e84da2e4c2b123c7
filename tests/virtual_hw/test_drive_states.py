"""Every state of the power drive state machine against every controlword command."""

from __future__ import annotations

from typing import Any

import pytest

from virtual_hw.drive.emergency import ErrorCode
from virtual_hw.drive.states import PowerState

S = PowerState
SHUTDOWN, SWITCH_ON, ENABLE, DISABLE_VOLTAGE, QUICK_STOP, RESET = 0x06, 0x07, 0x0F, 0x00, 0x02, 0x80

EXPECTED = {
    S.SWITCH_ON_DISABLED: {
        SHUTDOWN: S.READY_TO_SWITCH_ON,
        SWITCH_ON: S.SWITCH_ON_DISABLED,
        ENABLE: S.SWITCH_ON_DISABLED,
        DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        QUICK_STOP: S.SWITCH_ON_DISABLED,
        RESET: S.SWITCH_ON_DISABLED,
    },
    S.READY_TO_SWITCH_ON: {
        SHUTDOWN: S.READY_TO_SWITCH_ON,
        SWITCH_ON: S.SWITCHED_ON,
        ENABLE: S.OPERATION_ENABLED,
        DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        QUICK_STOP: S.SWITCH_ON_DISABLED,
        RESET: S.SWITCH_ON_DISABLED,
    },
    S.SWITCHED_ON: {
        SHUTDOWN: S.READY_TO_SWITCH_ON,
        SWITCH_ON: S.SWITCHED_ON,
        ENABLE: S.OPERATION_ENABLED,
        DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        QUICK_STOP: S.SWITCH_ON_DISABLED,
        RESET: S.SWITCH_ON_DISABLED,
    },
    S.OPERATION_ENABLED: {
        SHUTDOWN: S.READY_TO_SWITCH_ON,
        SWITCH_ON: S.SWITCHED_ON,
        ENABLE: S.OPERATION_ENABLED,
        DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        QUICK_STOP: S.QUICK_STOP_ACTIVE,
        RESET: S.SWITCH_ON_DISABLED,
    },
    S.QUICK_STOP_ACTIVE: {
        SHUTDOWN: S.QUICK_STOP_ACTIVE,
        SWITCH_ON: S.QUICK_STOP_ACTIVE,
        ENABLE: S.OPERATION_ENABLED,
        DISABLE_VOLTAGE: S.SWITCH_ON_DISABLED,
        QUICK_STOP: S.QUICK_STOP_ACTIVE,
        RESET: S.SWITCH_ON_DISABLED,
    },
    S.FAULT_REACTION_ACTIVE: dict.fromkeys((SHUTDOWN, SWITCH_ON, ENABLE, DISABLE_VOLTAGE, QUICK_STOP, RESET), S.FAULT),
    S.FAULT: {
        SHUTDOWN: S.FAULT,
        SWITCH_ON: S.FAULT,
        ENABLE: S.FAULT,
        DISABLE_VOLTAGE: S.FAULT,
        QUICK_STOP: S.FAULT,
        RESET: S.SWITCH_ON_DISABLED,
    },
}


def bring_to(bench: Any, state: PowerState) -> None:
    bench.write(0x605A, 0, 6, 2)
    bench.write(0x6060, 0, 10, 1)
    if state is S.SWITCH_ON_DISABLED:
        bench.controlword(0)
    elif state is S.READY_TO_SWITCH_ON:
        bench.controlword(SHUTDOWN)
    elif state is S.SWITCHED_ON:
        bench.controlword(SHUTDOWN, SWITCH_ON)
    else:
        bench.enable()
    if state is S.QUICK_STOP_ACTIVE:
        bench.controlword(QUICK_STOP)
    elif state is S.FAULT_REACTION_ACTIVE:
        bench.node.axis.fault(ErrorCode.FOLLOWING_ERROR)
    elif state is S.FAULT:
        bench.node.axis.fault(ErrorCode.FOLLOWING_ERROR)
        bench.run(50)
    assert bench.state is state


@pytest.mark.parametrize("state", EXPECTED, ids=lambda s: s.name.lower())
@pytest.mark.parametrize("controlword", [SHUTDOWN, SWITCH_ON, ENABLE, DISABLE_VOLTAGE, QUICK_STOP, RESET], ids=hex)
def test_every_state_under_every_controlword(bench: Any, state: PowerState, controlword: int) -> None:
    bring_to(bench, state)
    bench.controlword(controlword)
    bench.run(60)  # stops come to rest, automatic transitions happen
    assert bench.state is EXPECTED[state][controlword]


@pytest.mark.parametrize(
    ("state", "mask", "value"),
    [
        (S.SWITCH_ON_DISABLED, 0x4F, 0x40),
        (S.READY_TO_SWITCH_ON, 0x6F, 0x21),
        (S.SWITCHED_ON, 0x6F, 0x23),
        (S.OPERATION_ENABLED, 0x6F, 0x27),
        (S.QUICK_STOP_ACTIVE, 0x6F, 0x07),
        (S.FAULT_REACTION_ACTIVE, 0x4F, 0x0F),
        (S.FAULT, 0x4F, 0x08),
    ],
)
def test_statusword(bench: Any, state: PowerState, mask: int, value: int) -> None:
    bring_to(bench, state)
    if state is S.FAULT_REACTION_ACTIVE:
        bench.run(0.5)
    assert bench.read(0x6041) & mask == value


def test_fault_reset_is_an_edge(bench: Any) -> None:
    bench.controlword(RESET)
    bench.node.axis.fault(ErrorCode.FOLLOWING_ERROR)
    bench.controlword(RESET)
    assert bench.state is S.FAULT
    bench.controlword(0, RESET)
    assert bench.state is S.SWITCH_ON_DISABLED


def test_enabling_without_a_mode_is_refused(bench: Any) -> None:
    bench.controlword(SHUTDOWN, SWITCH_ON, ENABLE)
    assert bench.state is S.SWITCHED_ON


def test_brake_opens_only_with_torque(bench: Any) -> None:
    for words in ((), (SHUTDOWN,), (SWITCH_ON,)):
        bench.controlword(*words)
        assert bench.node.axis.brake
    bench.enable()
    assert not bench.node.axis.brake
    bench.controlword(DISABLE_VOLTAGE)
    assert bench.node.axis.brake


@pytest.mark.parametrize("option", range(9))
def test_quick_stop_options(bench: Any, option: int) -> None:
    bench.enable()
    bench.write(0x605A, 0, option, 2)
    bench.write(0x2100, 1, 40_000_000, 4)  # stiff, so that the arm keeps up with the ramp
    bench.write(0x2100, 2, 400_000, 4)
    bench.write(0x6085, 0, 200_000, 4)
    bench.write(0x6084, 0, 100_000, 4)
    bench.arm.dq[0] = 2.0
    bench.run(1)
    bench.controlword(QUICK_STOP)
    if option == 0:
        assert bench.state is S.SWITCH_ON_DISABLED
        return
    assert bench.state is S.QUICK_STOP_ACTIVE
    bench.run(40)
    slowed = bench.arm.dq[0]
    ramp = {1: 100_000, 2: 200_000}.get((option - 1) % 4 + 1)
    if ramp:
        assert slowed == pytest.approx(2.0 - 0.0405 * ramp / 65536 * 6.2832, abs=0.15)
    bench.run(600)
    assert bench.arm.dq[0] == pytest.approx(0.0, abs=1e-2)
    assert bench.state is (S.QUICK_STOP_ACTIVE if option >= 5 else S.SWITCH_ON_DISABLED)
    assert bool(bench.status & 0x400) is (option >= 5)


@pytest.mark.parametrize(("index", "controlword", "goal"), [
    (0x605B, SHUTDOWN, S.READY_TO_SWITCH_ON), (0x605C, SWITCH_ON, S.SWITCHED_ON),
])  # fmt: skip
@pytest.mark.parametrize("option", [0, 1])
def test_shutdown_and_disable_options(bench: Any, index: int, controlword: int, goal: PowerState, option: int) -> None:
    bench.enable()
    bench.write(index, 0, option, 2)
    bench.arm.dq[0] = 1.0
    bench.run(1)
    bench.controlword(controlword)
    assert (bench.state is goal) is (option == 0)
    bench.run(300)
    assert bench.state is goal


def test_operation_can_be_taken_up_again_while_it_is_being_disabled(bench: Any) -> None:
    bench.enable()
    bench.write(0x605C, 0, 1, 2)
    bench.arm.dq[0] = 5.0
    bench.controlword(SWITCH_ON)
    bench.controlword(ENABLE)
    bench.run(200)
    assert bench.state is S.OPERATION_ENABLED


@pytest.mark.parametrize("option", range(5))
def test_fault_reaction_options(bench: Any, option: int) -> None:
    bench.enable()
    bench.write(0x605E, 0, option, 2)
    bench.arm.dq[0] = 1.0
    bench.run(1)
    bench.node.axis.fault(ErrorCode.FOLLOWING_ERROR)
    assert bench.state is (S.FAULT if option == 0 else S.FAULT_REACTION_ACTIVE)
    bench.run(300)
    assert bench.state is S.FAULT
    assert bench.node.axis.brake


@pytest.mark.parametrize("option", [1, 2, 3, 4])
def test_halt_stops_and_stays_enabled(bench: Any, option: int) -> None:
    bench.enable()
    bench.write(0x605D, 0, option, 2)
    bench.arm.dq[0] = 1.0
    bench.controlword(0x10F)
    bench.run(1500)
    assert bench.state is S.OPERATION_ENABLED
    assert bench.arm.dq[0] == pytest.approx(0.0, abs=1e-2)
    assert bench.status & 0x1400 == 0x0400
    bench.controlword(0x0F)
    assert bench.status & 0x1400 == 0x1000


def test_a_stop_holds_a_loaded_joint(bench: Any) -> None:
    bench.arm.load_nm[0] = -30.0
    bench.enable(10)
    bench.write(0x6071, 0, round(30 / 66 * 1000), 2)
    bench.run(20)
    before = bench.arm.q[0]
    bench.controlword(QUICK_STOP)
    lowest = before
    for _ in range(200):
        bench.run(1)
        lowest = min(lowest, bench.arm.q[0])
    assert lowest > before - 0.01
