"""Bits on the wire, against a bit-by-bit reading of ISO 11898-1."""

from __future__ import annotations

import random

import pytest

from virtual_hw.bus.frames import EXTENDED, REMOTE, arbitration_key, frame, frame_bits


def bits_of(value: int, width: int) -> list[int]:
    return [value >> k & 1 for k in range(width - 1, -1, -1)]


def bit_by_bit(can_id: int, data: bytes) -> int:
    """Length of a frame from its bits, one after the other."""
    if can_id & EXTENDED:
        header = [0, *bits_of(can_id >> 18 & 0x7FF, 11), 1, 1, *bits_of(can_id & 0x3FFFF, 18), 0, 0, 0]
    else:
        header = [0, *bits_of(can_id & 0x7FF, 11), 1 if can_id & REMOTE else 0, 0, 0]
    bits = header + bits_of(len(data), 4)
    if not can_id & REMOTE:
        for byte in data:
            bits += bits_of(byte, 8)
    crc = 0
    for bit in bits:
        invert = bit ^ crc >> 14
        crc = crc << 1 & 0x7FFF
        if invert:
            crc ^= 0x4599
    bits += bits_of(crc, 15)
    sent: list[int] = []
    for bit in bits:
        sent.append(bit)
        if sent[-5:] in ([0] * 5, [1] * 5):
            sent.append(1 - bit)
    return len(sent) + 10


@pytest.mark.parametrize("flags", [0, REMOTE, EXTENDED])
def test_bits_are_exact(flags: int) -> None:
    draw = random.Random(flags)
    for _ in range(400):
        can_id = draw.randrange(1 << (29 if flags & EXTENDED else 11)) | flags
        length = draw.randrange(9)
        data = bytes(draw.choice((0x00, 0xFF, 0xF0, 0x1F, draw.randrange(256))) for _ in range(length))
        assert frame_bits(frame(can_id, data)) == bit_by_bit(can_id, data)


@pytest.mark.parametrize(("length", "plain", "worst"), [(0, 47, 55), (4, 79, 95), (8, 111, 135)])
def test_bits_lie_between_no_stuffing_and_the_worst_case(length: int, plain: int, worst: int) -> None:
    draw = random.Random(length)
    seen = [
        3 + frame_bits(frame(draw.randrange(0x800), bytes(draw.choice((0, 0xFF, 0x78, 0x55)) for _ in range(length))))
        for _ in range(2000)
    ]
    assert plain <= min(seen) <= plain + 2
    assert plain < max(seen) <= worst


def test_arbitration_follows_the_bits_of_the_arbitration_field() -> None:
    def key(can_id: int) -> int:
        return arbitration_key(can_id.to_bytes(4, "little"))

    order = [0x000, 0x080, 0x181, 0x181 | REMOTE, 0x181 << 18 | EXTENDED, 0x182, 0x7FF]
    assert sorted(order, key=key) == order
