"""The frame codec: what goes in comes out, and bytes that are no frame never pass for one."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from driver.bus.errors import decode_error_frame
from driver.bus.frames import (
    ERROR_FLAG,
    EXTENDED_FLAG,
    FRAME_BYTES,
    REMOTE_FLAG,
    Frame,
    Mark,
    MarkKind,
    iter_frames,
    pack,
    pack_mark,
    unpack,
)

standard_ids = st.integers(0, 0x7FF)
payloads = st.binary(max_size=8)
frames = st.builds(Frame, standard_ids, payloads)
marks = st.builds(Mark, st.sampled_from(MarkKind), st.integers(0, 2**64 - 1))


def test_layout_is_that_of_the_kernel() -> None:
    assert pack(0x181, b"\x27\x06\x01") == bytes.fromhex("81010000 03 000000 2706010000000000")
    assert pack_mark(MarkKind.TICK, 0x0102030405060708) == bytes.fromhex("ffffffff 01 000000 0807060504030201")


@given(st.lists(frames | marks, max_size=20))
def test_packets_come_out_as_they_went_in(items: list[Frame | Mark]) -> None:
    packet = b"".join(pack(*i) if isinstance(i, Frame) else pack_mark(*i) for i in items)
    assert len(packet) == FRAME_BYTES * len(items)
    assert list(iter_frames(packet)) == items


@given(st.integers(0, 0x1FFF_FFFF), payloads)
def test_extended_identifiers_keep_their_flag(identifier: int, data: bytes) -> None:
    if identifier | EXTENDED_FLAG == 0x9FFF_FFFF and not data:
        return
    assert unpack(pack(identifier | EXTENDED_FLAG, data)) == Frame(identifier | EXTENDED_FLAG, data)


@given(st.binary(min_size=16, max_size=16))
def test_any_16_bytes_are_a_frame_a_mark_or_refused(raw: bytes) -> None:
    try:
        item = unpack(raw)
    except ValueError:
        assert raw[4] > 8 or (raw[:4] == b"\xff\xff\xff\xff" and raw[4] not in list(MarkKind))
    else:
        assert isinstance(item, Mark) == (raw[:4] == b"\xff\xff\xff\xff")
        if isinstance(item, Frame):
            assert item.data == raw[8 : 8 + raw[4]]


@given(st.binary().filter(lambda raw: len(raw) % FRAME_BYTES))
def test_cut_packets_are_refused(raw: bytes) -> None:
    with pytest.raises(ValueError, match="not whole frames"):
        list(iter_frames(raw))


@pytest.mark.parametrize(
    ("can_id", "data"),
    [(0x181, bytes(9)), (0x800, b""), (-1, b""), (0xFFFF_FFFF, b""), (0x1_0000_0000, b""), (REMOTE_FLAG | 0x800, b"")],
)
def test_what_no_controller_can_send_is_refused(can_id: int, data: bytes) -> None:
    with pytest.raises(ValueError, match="CAN"):
        pack(can_id, data)


@pytest.mark.parametrize(
    ("can_id", "data", "words", "bus_off", "lost"),
    [
        (0x040, bytes(8), "bus-off", True, False),
        (0x004, bytes((0, 0x01, 0, 0, 0, 0, 0, 0)), "receive buffer", False, True),
        (0x004, bytes((0, 0x20, 0, 0, 0, 0, 0, 0)), "error passive", False, False),
        (0x004, bytes(8), "controller problem", False, False),
        (0x020, bytes(8), "no acknowledgement", False, False),
        (0x1000, b"", "error class", False, False),
    ],
)
def test_error_frames_in_words(can_id: int, data: bytes, words: str, bus_off: bool, lost: bool) -> None:
    error = decode_error_frame(Frame(ERROR_FLAG | can_id, data))
    assert words in error.words
    assert (error.bus_off, error.frames_lost) == (bus_off, lost)


def test_a_data_frame_is_no_error_frame() -> None:
    (frame,) = iter_frames(struct.pack("<IB3x8s", 0x181, 0, b""))
    assert isinstance(frame, Frame)
    with pytest.raises(ValueError, match="no error frame"):
        decode_error_frame(frame)
