"""Lost hosts, emergencies, and what the drive does about them."""

from __future__ import annotations

import itertools
import struct
from typing import Any

import pytest

from virtual_hw.drive.emergency import ErrorCode, register_bit
from virtual_hw.drive.states import PowerState

S = PowerState
MASTER = 0x7E
WATCH_MS = 20


@pytest.fixture
def watched(bench: Any) -> Any:
    """Enabled in torque mode, watching the host's heartbeat, quick stop on its loss."""
    bench.write(0x605A, 0, 6, 2)
    bench.write(0x6007, 0, 3, 2)
    bench.write(0x1016, 1, MASTER << 16 | WATCH_MS, 4)
    bench.nmt(0x01)
    bench.enable(10)
    return bench


def beat(bench: Any, times: int = 1) -> None:
    for _ in range(times):
        bench.send(0x700 + MASTER, b"\x05")
        bench.run(10)


def test_producer_heartbeat_tells_the_state_in_time(bench: Any) -> None:
    bench.write(0x1017, 0, 10, 2)
    bench.run(1)
    bench.heard.clear()
    bench.run(50)
    bench.nmt(0x01)
    bench.run(20)
    beats = [(t, data) for t, can_id, data in bench.heard if can_id == 0x701]
    assert [data for _, data in beats] == [b"\x7f"] * 5 + [b"\x05"] * 2
    gaps = [later - earlier for (earlier, _), (later, _) in itertools.pairwise(beats)]
    assert all(abs(gap - 10_000_000) < 10_000 for gap in gaps)


def test_a_watch_is_armed_by_the_first_heartbeat(watched: Any) -> None:
    watched.run(100)
    assert watched.state is S.OPERATION_ENABLED


def test_a_heartbeat_in_time_keeps_the_axis_enabled(watched: Any) -> None:
    beat(watched, 20)
    assert watched.state is S.OPERATION_ENABLED
    assert watched.emergencies() == []


def test_a_lost_heartbeat_stops_the_axis_within_its_time(watched: Any) -> None:
    watched.arm.dq[0] = 1.0
    beat(watched)
    watched.heard.clear()
    watched.run(WATCH_MS - 10.5)
    assert watched.state is S.OPERATION_ENABLED
    watched.run(1.5)
    assert watched.state is S.QUICK_STOP_ACTIVE
    assert watched.emergencies() == [ErrorCode.HEARTBEAT_LOST]
    watched.run(1500)
    assert watched.arm.dq[0] == pytest.approx(0.0, abs=1e-2)
    assert watched.state is S.QUICK_STOP_ACTIVE


@pytest.mark.parametrize(
    ("option", "state"),
    [(0, S.OPERATION_ENABLED), (1, S.FAULT), (2, S.SWITCH_ON_DISABLED), (3, S.QUICK_STOP_ACTIVE)],
)
def test_connection_lost_options(watched: Any, option: int, state: PowerState) -> None:
    watched.write(0x6007, 0, option, 2)
    beat(watched)
    watched.run(200)
    assert watched.state is state


@pytest.mark.parametrize(("behaviour", "nmt"), [(0, 0x7F), (1, 0x05), (2, 0x04)])
def test_error_behaviour_of_communication(watched: Any, behaviour: int, nmt: int) -> None:
    watched.write(0x1029, 1, behaviour, 1)
    beat(watched)
    watched.run(50)
    assert watched.node.nmt == nmt


@pytest.mark.parametrize("option", [1, 3])
def test_after_a_lost_heartbeat_only_reset_communication_helps(watched: Any, option: int) -> None:
    watched.write(0x6007, 0, option, 2)
    beat(watched)
    watched.run(100)
    stopped = watched.state
    beat(watched, 3)
    watched.controlword(0x00, 0x80)
    watched.controlword(0x06, 0x07, 0x0F)
    assert watched.state is (stopped if option == 1 else S.SWITCHED_ON)
    watched.nmt(0x82)
    watched.controlword(0x00, 0x80)
    watched.controlword(0x06, 0x07, 0x0F)
    assert watched.state is S.OPERATION_ENABLED


def test_quick_stop_of_a_lost_host_cannot_be_left_to_enabled(watched: Any) -> None:
    beat(watched)
    watched.run(100)
    watched.controlword(0x0F)
    assert watched.state is S.QUICK_STOP_ACTIVE


def test_rpdo_deadline(bench: Any) -> None:
    bench.commission(10)
    bench.nmt(0x80)
    bench.write(0x1400, 5, 5, 2)
    bench.write(0x6007, 0, 3, 2)
    bench.write(0x605A, 0, 6, 2)
    bench.nmt(0x01)
    for word in (0x06, 0x07, 0x0F, 0x0F):
        bench.cycle(struct.pack("<Hh", word, 0))
    assert bench.state is S.OPERATION_ENABLED
    bench.heard.clear()
    bench.run(4)
    assert bench.emergencies() == []
    bench.run(2)
    assert bench.emergencies() == [ErrorCode.RPDO_DEADLINE]
    assert bench.state is S.QUICK_STOP_ACTIVE
    bench.cycle(struct.pack("<Hh", 0x0F, 0))
    assert bench.emergencies() == [0]
    assert bench.state is S.OPERATION_ENABLED


@pytest.mark.parametrize("nmt", [0x02, 0x82])
def test_a_host_that_stops_or_resets_communication_is_a_lost_connection(watched: Any, nmt: int) -> None:
    watched.nmt(nmt)
    watched.run(1)
    assert watched.state is S.QUICK_STOP_ACTIVE


def test_a_drive_in_fault_still_says_why_after_a_reset_of_its_communication(bench: Any) -> None:
    bench.node.axis.fault(ErrorCode.HEARTBEAT_LOST)
    bench.node.axis.fault(0x3210)
    bench.nmt(0x82)
    assert bench.state is S.FAULT
    assert bench.read(0x603F) == 0x3210
    assert bench.read(0x1001) == 0x05, "what is left is of voltage, not of communication"
    bench.nmt(0x81)
    assert bench.read(0x603F) == bench.read(0x1001) == 0


def test_a_fault_is_told_once_and_kept_in_the_history(bench: Any) -> None:
    bench.heard.clear()
    for code in (ErrorCode.FOLLOWING_ERROR, ErrorCode.FOLLOWING_ERROR, 0x2310):
        bench.node.axis.fault(code)
    bench.run(1)
    messages = bench.frames(0x081)
    assert messages == [struct.pack("<HB5x", 0x8611, 0x21), struct.pack("<HB5x", 0x2310, 0x23)]
    assert bench.read(0x603F) == 0x2310
    assert bench.read(0x1001) == 0x23
    assert [bench.read(0x1003, k) for k in range(3)] == [2, 0x2310, 0x8611]


def test_a_fault_reset_tells_the_end_of_all_errors(bench: Any) -> None:
    bench.node.axis.fault(ErrorCode.FOLLOWING_ERROR)
    bench.run(1)
    bench.heard.clear()
    bench.controlword(0x00, 0x80)
    bench.run(1)
    assert bench.state is S.SWITCH_ON_DISABLED
    assert bench.read(0x603F) == 0
    assert bench.read(0x1001) == 0
    assert bench.read(0x1003, 0) == 1


def test_the_history_is_cleared_by_writing_zero(bench: Any) -> None:
    for code in range(0x2310, 0x231C):
        bench.node.axis.fault(code)
    assert bench.read(0x1003, 0) == 8
    assert bench.read(0x1003, 8) == 0x2314
    assert bench.write(0x1003, 0, 0, 1) == 0
    assert [bench.read(0x1003, k) for k in range(9)] == [0] * 9


def test_no_emergencies_while_stopped(bench: Any) -> None:
    bench.nmt(0x02)
    bench.heard.clear()
    bench.node.axis.fault(ErrorCode.FOLLOWING_ERROR)
    bench.run(1)
    assert bench.emergencies() == []


@pytest.mark.parametrize(
    ("code", "bit"), [(0x2310, 0x02), (0x3210, 0x04), (0x4310, 0x08), (0x8130, 0x10), (0x8210, 0x10), (0x8611, 0x20)]
)
def test_error_register_bits(code: int, bit: int) -> None:
    assert register_bit(code) == bit


def test_a_stopped_node_is_deaf_to_sdo_and_hears_nmt(bench: Any) -> None:
    bench.nmt(0x02)
    with pytest.raises(ValueError, match="not enough values"):
        bench.read(0x1000)
    bench.nmt(0x80)
    assert bench.read(0x1000) == 0x00020192


def test_nmt_is_for_the_addressed_node_or_all(bench: Any) -> None:
    bench.nmt(0x01, node=2)
    assert bench.node.nmt == 0x7F
    bench.nmt(0x01, node=0)
    assert bench.node.nmt == 0x05
