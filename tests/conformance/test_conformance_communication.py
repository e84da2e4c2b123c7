"""NMT, boot-up, heartbeats both ways, and the SDO server."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from config import InputError
from driver.bus.frames import pack
from driver.cia402 import objects
from driver.cia402.nodes import Nmt, NmtState
from driver.cia402.pdo import heartbeat
from driver.cia402.states import Control, State

HOST = 126


def beats(bench: Any, heard: list[Any]) -> list[int]:
    return [frame.data[0] for frame in heard if frame.can_id == 0x700 + bench.node_id]


def ask(bench: Any, request: bytes) -> bytes:
    """The answer to one raw SDO request."""
    bench.forget()
    heard = bench.run(5, sync=False, extra=pack(0x600 + bench.node_id, request.ljust(8, b"\0")))
    answers = [frame.data for frame in heard if frame.can_id == 0x580 + bench.node_id]
    assert len(answers) == 1, f"{len(answers)} answers to {request.hex(' ')}"
    return bytes(answers[0])


def abort_of(answer: bytes) -> int:
    assert answer[0] == 0x80, f"no abort: {answer.hex(' ')}"
    return int.from_bytes(answer[4:8], "little")


# ── NMT ──


@pytest.mark.parametrize("command", [Nmt.RESET_NODE, Nmt.RESET_COMMUNICATION])
def test_boot_up_after_a_reset(bench: Any, command: Nmt) -> None:
    bench.nmt(command)
    assert NmtState.BOOT_UP in beats(bench, bench.run(500 if bench.real else 5, sync=False))


def test_the_heartbeat_tells_every_nmt_state(bench: Any) -> None:
    bench.sdo.write_verified(objects.PRODUCER_HEARTBEAT_MS, 0, 10)
    for command, state in (
        (Nmt.PRE_OPERATIONAL, NmtState.PRE_OPERATIONAL),
        (Nmt.START, NmtState.OPERATIONAL),
        (Nmt.STOP, NmtState.STOPPED),
    ):
        bench.nmt(command)
        bench.run(10, sync=False)
        heard = beats(bench, bench.run(50, sync=False))
        assert set(heard) == {state}
        assert len(heard) in range(8, 13)  # 100 ms of the bench's time.


def test_commands_to_other_nodes_are_ignored_and_those_to_all_are_not(bench: Any) -> None:
    bench.sdo.write_verified(objects.PRODUCER_HEARTBEAT_MS, 0, 10)
    bench.nmt(Nmt.STOP, bench.node_id % 127 + 1)
    assert set(beats(bench, bench.run(10, sync=False))) == {NmtState.OPERATIONAL}
    bench.nmt(Nmt.PRE_OPERATIONAL, 0)
    bench.run(2, sync=False)
    assert set(beats(bench, bench.run(20, sync=False))) == {NmtState.PRE_OPERATIONAL}


def test_a_stopped_node_answers_no_sdo(bench: Any) -> None:
    bench.nmt(Nmt.STOP)
    bench.forget()
    request = pack(0x600 + bench.node_id, b"\x40\x00\x10\x00".ljust(8, b"\0"))
    heard = bench.run(10, sync=False, extra=request)
    assert not [frame for frame in heard if frame.can_id == 0x580 + bench.node_id]


def test_a_reset_of_the_communication_restores_communication_objects_alone(bench: Any) -> None:
    bench.sdo.write_verified(objects.PRODUCER_HEARTBEAT_MS, 0, 10)
    bench.sdo.write_verified(objects.QUICK_STOP_OPTION, 0, 5)
    bench.nmt(Nmt.RESET_COMMUNICATION)
    bench.run(500 if bench.real else 5, sync=False)
    assert bench.sdo.read(objects.PRODUCER_HEARTBEAT_MS) == 0
    assert bench.sdo.read(objects.QUICK_STOP_OPTION) == 5


# ── the host's heartbeat ──


def test_a_lost_host_is_a_fault_that_only_a_reset_of_the_communication_ends(bench: Any) -> None:
    bench.sdo.write_verified(objects.CONSUMER_HEARTBEAT, 1, HOST << 16 | 20)
    # Supervision begins with the host's first heartbeat.
    assert bench.emergencies(bench.run(50, Control.SHUTDOWN)) == []
    for _ in range(5):
        assert bench.emergencies(bench.run(5, Control.SHUTDOWN, extra=heartbeat(HOST))) == []
    heard = bench.run(30, Control.SHUTDOWN)
    assert 0x8130 in bench.emergencies(heard)
    assert bench.state() is State.FAULT
    if not bench.real:  # Not every drive is that strict.
        bench.nmt(Nmt.START)
        bench.reset_fault()
        assert bench.state() is State.FAULT
    bench.prepare()
    assert bench.settle(Control.SHUTDOWN) is State.READY


# ── SDO ──


def test_expedited_reading_and_writing(bench: Any) -> None:
    device_type = bench.drive.identity.device_type
    assert ask(bench, b"\x40\x00\x10\x00") == struct.pack("<BHBI", 0x43, 0x1000, 0, device_type)
    assert ask(bench, b"\x2b\x5a\x60\x00\x05\x00") == struct.pack("<BHBI", 0x60, 0x605A, 0, 0)
    assert ask(bench, b"\x40\x5a\x60\x00")[:6] == b"\x4b\x5a\x60\x00\x05\x00"


@pytest.mark.parametrize(
    ("request_bytes", "aborts"),
    [
        (b"\x40\xff\x5f\x00", {0x06020000}),
        (b"\x40\x18\x10\x20", {0x06090011}),
        (b"\x2b\x41\x60\x00\x00\x00", {0x06010002}),
        (b"\x23\x00\x10\x00\x00\x00\x00\x00", {0x06010002}),
        (b"\x23\x40\x60\x00\x06\x00\x00\x00", {0x06070010, 0x06070012}),
        (b"\x2f\x40\x60\x00\x06", {0x06070010, 0x06070013}),
        (b"\x2b\x5a\x60\x00\x63\x00", {0x06090030, 0x06090031}),
        (b"\xe0\x00\x10\x00", {0x05040001}),
        (b"\x60", {0x05040001, 0x05030000}),
    ],
    ids=[
        "no object", "no sub-index", "read-only", "constant", "too long", "too short", "out of range",
        "no command", "segment without a beginning",
    ],
)  # fmt: skip
def test_what_is_refused(bench: Any, request_bytes: bytes, aborts: set[int]) -> None:
    answer = ask(bench, request_bytes)
    assert abort_of(answer) in aborts
    if request_bytes[0] not in (0x60, 0xE0):
        assert answer[1:4] == request_bytes[1:4]


def test_a_toggle_bit_that_does_not_toggle_ends_the_transfer(bench: Any) -> None:
    first = ask(bench, b"\x40\x08\x10\x00")
    if first[0] & 0x02:
        pytest.skip("this drive's name fits an expedited answer")
    assert ask(bench, b"\x60")[0] & 0xF0 == 0x00
    assert abort_of(ask(bench, b"\x60")) == 0x05030000
    assert ask(bench, b"\x40\x00\x10\x00")[0] == 0x43


def test_a_text_in_segments(bench: Any) -> None:
    first = ask(bench, b"\x40\x08\x10\x00")
    assert first[0] in (0x41, 0x43, 0x47, 0x4B, 0x4F)
    if first[0] == 0x41:
        size, text, toggle, last = int.from_bytes(first[4:8], "little"), b"", 0, False
        while not last:
            segment = ask(bench, bytes((0x60 | toggle,)))
            assert segment[0] & 0x10 == toggle
            text += segment[1 : 8 - (segment[0] >> 1 & 7)]
            last, toggle = bool(segment[0] & 1), toggle ^ 0x10
        assert len(text) == size
        assert text.decode("ascii").isprintable()


def test_objects_that_a_drive_must_have(bench: Any) -> None:
    identity = bench.drive.identity
    assert bench.sdo.read(objects.IDENTITY, 1) == identity.vendor_id
    assert bench.sdo.read(objects.IDENTITY, 2) == identity.product_code
    assert bench.sdo.read(objects.SUPPORTED_MODES) & 1 << 7  # CSP
    assert bench.sdo.read(objects.MODE_DISPLAY) == 8
    for index in (objects.ERROR_REGISTER, objects.RATED_TORQUE_MNM, objects.MAX_TORQUE, 0x6064, 0x6077):
        bench.sdo.read(index)


def test_an_unsupported_mode_is_not_taken_up(bench: Any) -> None:
    unsupported = next(mode for mode in range(1, 11) if not bench.sdo.read(objects.SUPPORTED_MODES) >> (mode - 1) & 1)
    try:
        bench.sdo.write(objects.MODE, 0, unsupported)
    except InputError as refused:
        assert "abort" in str(refused)
    bench.run(5, Control.DISABLE_VOLTAGE)
    assert bench.sdo.read(objects.MODE_DISPLAY) == 8
