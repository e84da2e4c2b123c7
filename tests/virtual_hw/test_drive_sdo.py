"""The SDO server: transfers and every abort."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from virtual_hw.drive.aborts import Abort
from virtual_hw.drive.states import PowerState


def abort_of(answer: bytes) -> int:
    assert answer[0] == 0x80
    return int.from_bytes(answer[4:], "little")


def test_expedited_round_trip(bench: Any) -> None:
    assert bench.write(0x6085, 0, 123_456, 4) == 0
    assert bench.read(0x6085) == 123_456
    assert bench.write(0x60B2, 0, -17, 2) == 0
    assert bench.read(0x60B2) == -17


def test_identity_is_the_eds(bench: Any) -> None:
    assert bench.read(0x1000) == 0x00020192
    assert bench.read(0x1018, 1) == 0x0E7D
    assert bench.read(0x1018, 2) == 0x0402


def test_rated_torque_is_the_joints(bench: Any) -> None:
    assert bench.read(0x6076) == 66_000


def test_measured_objects_are_those_of_the_motor(bench: Any) -> None:
    assert bench.read(0x2110) == 315
    assert [bench.read(0x2111, k) for k in (1, 2, 3)] == [1000, -250, -750]
    assert bench.read(0x6064) == bench.arm.counts(0)


def test_segmented_upload(bench: Any) -> None:
    answer = bench.sdo(struct.pack("<BHB4x", 0x40, 0x1008, 0))
    size = int.from_bytes(answer[4:], "little")
    assert (answer[0], size) == (0x41, len("Etude 402"))
    text, toggle = b"", 0
    while True:
        answer = bench.sdo(bytes((0x60 | toggle << 4,)) + bytes(7))
        assert answer[0] >> 4 == toggle
        text += answer[1 : 8 - (answer[0] >> 1 & 7)]
        if answer[0] & 1:
            break
        toggle ^= 1
    assert text == b"Etude 402"


def test_segmented_download(bench: Any) -> None:
    assert bench.sdo(struct.pack("<BHBI", 0x21, 0x6085, 0, 4))[0] == 0x60
    assert bench.sdo(bytes((0x00 | 3 << 1 | 1,)) + struct.pack("<I", 777) + bytes(3))[0] == 0x20
    assert bench.read(0x6085) == 777


def test_segmented_download_in_two_pieces(bench: Any) -> None:
    assert bench.sdo(struct.pack("<BHBI", 0x21, 0x6085, 0, 4))[0] == 0x60
    value = struct.pack("<I", 70_000)
    assert bench.sdo(bytes((0x00 | 5 << 1,)) + value[:2] + bytes(5))[0] == 0x20
    assert bench.sdo(bytes((0x10 | 5 << 1 | 1,)) + value[2:] + bytes(5))[0] == 0x30
    assert bench.read(0x6085) == 70_000


def test_a_wrong_toggle_bit_is_refused(bench: Any) -> None:
    bench.sdo(struct.pack("<BHB4x", 0x40, 0x1008, 0))
    answer = bench.sdo(b"\x70" + bytes(7))
    assert abort_of(answer) == Abort.TOGGLE
    assert answer[1:4] == struct.pack("<HB", 0x1008, 0)


def test_a_segment_without_a_transfer_is_refused(bench: Any) -> None:
    assert abort_of(bench.sdo(b"\x60" + bytes(7))) == Abort.COMMAND
    assert abort_of(bench.sdo(b"\x01" + bytes(7))) == Abort.COMMAND


def test_the_clients_abort_ends_a_transfer_without_an_answer(bench: Any) -> None:
    bench.sdo(struct.pack("<BHB4x", 0x40, 0x1008, 0))
    with pytest.raises(ValueError, match="not enough values"):
        bench.sdo(struct.pack("<BHBI", 0x80, 0x1008, 0, 0x05040000))
    assert abort_of(bench.sdo(b"\x60" + bytes(7))) == Abort.COMMAND


@pytest.mark.parametrize("command", [0xA0, 0xC6, 0xE0])
def test_block_transfer_and_unknown_commands_are_refused(bench: Any, command: int) -> None:
    assert abort_of(bench.sdo(struct.pack("<BHB4x", command, 0x1008, 0))) == Abort.COMMAND


@pytest.mark.parametrize(
    ("index", "subindex", "value", "size", "code"),
    [
        (0x5FFF, 0, 0, 1, Abort.NO_OBJECT),
        (0x1018, 9, 0, 1, Abort.NO_SUBINDEX),
        (0x1000, 0, 0, 4, Abort.READ_ONLY),
        (0x1018, 0, 0, 1, Abort.READ_ONLY),
        (0x6041, 0, 0, 2, Abort.READ_ONLY),
        (0x6040, 0, 0, 4, Abort.TOO_LONG),
        (0x6085, 0, 1, 2, Abort.TOO_SHORT),
        (0x605A, 0, 9, 2, Abort.TOO_HIGH),
        (0x605A, 0, -1, 2, Abort.TOO_LOW),
        (0x6060, 0, 7, 1, Abort.VALUE),
        (0x1003, 0, 1, 1, Abort.VALUE),
        (0x1010, 1, 1, 4, Abort.CANNOT_STORE),
        (0x1005, 0, 0x2000_0080, 4, Abort.VALUE),
        (0x1016, 1, 0x00FF_0010, 4, Abort.VALUE),
    ],
)
def test_refused_writes(bench: Any, index: int, subindex: int, value: int, size: int, code: Abort) -> None:
    assert bench.write(index, subindex, value, size) == code


def test_refused_reads(bench: Any) -> None:
    assert abort_of(bench.sdo(struct.pack("<BHB4x", 0x40, 0x5FFF, 0))) == Abort.NO_OBJECT
    assert abort_of(bench.sdo(struct.pack("<BHB4x", 0x40, 0x1018, 9))) == Abort.NO_SUBINDEX


def test_a_refused_write_changes_nothing(bench: Any) -> None:
    before = bench.read(0x605A)
    bench.write(0x605A, 0, 9, 2)
    assert bench.read(0x605A) == before


def test_two_watches_of_one_node_are_refused(bench: Any) -> None:
    assert bench.write(0x1016, 1, 0x0001_0010, 4) == 0
    assert bench.write(0x1016, 2, 0x0001_0020, 4) == Abort.INCOMPATIBLE


def test_a_frame_of_another_length_is_no_request(bench: Any) -> None:
    with pytest.raises(ValueError, match="not enough values"):
        bench.sdo(b"\x40\x00\x10")


def test_stored_parameters_outlive_a_reset_and_others_do_not(bench: Any) -> None:
    bench.write(0x6085, 0, 111, 4)
    assert bench.write(0x1010, 1, int.from_bytes(b"save", "little"), 4) == 0
    bench.write(0x6085, 0, 222, 4)
    bench.nmt(0x81)
    assert bench.read(0x6085) == 111


def test_reset_node_takes_torque_and_settings_away(bench: Any) -> None:
    bench.enable()
    bench.write(0x6085, 0, 222, 4)
    default = 400_000
    bench.heard.clear()
    bench.nmt(0x81)
    assert bench.frames(0x701) == [b"\0"]
    bench.run(1)
    assert bench.state is PowerState.SWITCH_ON_DISABLED
    assert bench.node.axis.brake
    assert bench.read(0x6085) == default


def test_reset_communication_keeps_the_axis_settings(bench: Any) -> None:
    bench.write(0x6085, 0, 222, 4)
    bench.write(0x1017, 0, 5, 2)
    bench.nmt(0x82)
    assert bench.read(0x6085) == 222
    assert bench.read(0x1017) == 0
