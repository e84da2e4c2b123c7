"""The 16-byte Linux ``struct can_frame``, and how many bits a frame occupies on the wire.

Bits follow ISO 11898-1 (classical CAN): a five-in-a-row run, stuff bits included, is followed by a stuff bit of the
other polarity from start of frame to the end of the CRC sequence. The count is exact for the frame at hand.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FRAME_SIZE = 16
EXTENDED = 0x8000_0000
REMOTE = 0x4000_0000
ERROR = 0x2000_0000
MARK_ID = 0xFFFF_FFFF

CAN_FRAME = struct.Struct("<IB3x8s")
MARK = struct.Struct("<IB3xQ")

INTERFRAME_BITS = 3
_TRAILER_BITS = 10
"""CRC delimiter, acknowledge slot and its delimiter, end of frame: never stuffed."""
_CRC_POLYNOMIAL = 0x4599


def frame(can_id: int, data: bytes = b"") -> bytes:
    """One ``struct can_frame``: identifier with the kernel's flag bits, at most 8 data bytes."""
    return CAN_FRAME.pack(can_id, len(data), data)


def error_frame(error_class: int, data: bytes = bytes(8)) -> bytes:
    """An error message as ``linux/can/error.h`` encodes it; it never occupies the bus."""
    return CAN_FRAME.pack(ERROR | error_class, 8, data)


def arbitration_key(identifier: bytes) -> int:
    """Order in which identifiers win the bus, from the four bytes in a `struct can_frame`: the smaller key wins.

    The key is the arbitration field as sent: base identifier, RTR or SRR, IDE, extension, RTR. So a standard frame
    wins over an extended one with the same base identifier, and a data frame over a remote one.
    """
    can_id = int.from_bytes(identifier, "little")
    remote = 1 if can_id & REMOTE else 0
    if can_id & EXTENDED:
        base, extension = (can_id >> 18) & 0x7FF, can_id & 0x3FFFF
        return base << 21 | 1 << 20 | 1 << 19 | extension << 1 | remote
    return (can_id & 0x7FF) << 21 | remote << 20


def _stuff_table(width: int) -> NDArray[np.uint8]:
    """Run of the stuffing automaton over every word of ``width`` bits from each of its eight states.

    A state is ``bit << 2 | run - 1``, the last bit sent and how often it stands in a row (1 to 4; a fifth one is
    followed by its stuff bit at once). Entry ``state << width | word`` is ``stuff bits << 3 | next state``.
    """
    words = np.tile(np.arange(1 << width), 8)
    state = np.repeat(np.arange(8), 1 << width)
    bit, run = state >> 2, (state & 3) + 1
    count = np.zeros_like(words)
    for shift in range(width - 1, -1, -1):
        sent = words >> shift & 1
        run = np.where(sent == bit, run + 1, 1)
        stuffed = run == 5
        bit = np.where(stuffed, 1 - sent, sent)
        run = np.where(stuffed, 1, run)
        count += stuffed
    return (count << 3 | bit << 2 | run - 1).astype(np.uint8)


def _by_state(table: NDArray[np.uint8]) -> list[bytes]:
    return [row.tobytes() for row in table.reshape(8, -1)]


def _joined(first: NDArray[np.uint8], second: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The table of two runs one after the other."""
    joined: NDArray[np.uint8] = second.reshape(8, -1)[first & 7] + (first[:, None] & 0xF8)
    return joined


def _crc_table(bits_after: int) -> NDArray[np.uint16]:
    """CRC-15 contribution of every byte that ``bits_after`` more bits follow (the CRC is linear)."""
    crc = np.arange(256) << 7
    for _ in range(8 + bits_after):
        crc = crc << 1 & 0x7FFF ^ (crc >> 14 & 1) * _CRC_POLYNOMIAL
    return crc.astype(np.uint16)


_BYTE, _CRC = _stuff_table(8), [_crc_table(8 * after) for after in range(8)]
_STUFF_8, _STUFF_15, _STUFF_16 = map(_by_state, (_BYTE, _joined(_stuff_table(7), _BYTE), _joined(_BYTE, _BYTE)))
_CRC_8 = array("H", _CRC[0].tobytes())
_CRC_16 = [array("H", (_CRC[after + 1][:, None] ^ _CRC[after]).tobytes()) for after in range(7)]
_WORDS = [struct.Struct(f">8x{n // 2}H{'B' * (n % 2)}{8 - n}x").unpack for n in range(9)]
"""The data of a frame as big-endian words, and a last byte, by number of data bytes."""


_FOUR_WORDS: Callable[[bytes], tuple[int, int, int, int]] = struct.Struct(">8x4H").unpack


def _crc_step(crc: int, bit: int) -> int:
    feedback = (crc >> 14 ^ bit) & 1
    crc = crc << 1 & 0x7FFF
    return crc ^ _CRC_POLYNOMIAL if feedback else crc


MOST_HEADERS = 4096
_HEADERS: dict[bytes, tuple[int, int, int, int]] = {}
"""By the five bytes of identifier and length. A dictionary: a call of a cached function costs as much as the rest."""


def _header(five: bytes) -> tuple[int, int, int, int]:
    """(data bytes, unstuffed bits in all, CRC contribution of the header, stuffing after the header)."""
    if len(_HEADERS) >= MOST_HEADERS:
        _HEADERS.clear()
    identifier, length = five[:4], five[4]
    can_id = int.from_bytes(identifier, "little")
    remote = 1 if can_id & REMOTE else 0
    if can_id & EXTENDED:
        fields = [(0, 1), (can_id >> 18 & 0x7FF, 11), (3, 2), (can_id & 0x3FFFF, 18), (remote, 1), (0, 2), (length, 4)]
    else:
        fields = [(0, 1), (can_id & 0x7FF, 11), (remote, 1), (0, 2), (length, 4)]
    bits = [value >> k & 1 for value, width in fields for k in range(width - 1, -1, -1)]
    data_bytes = 0 if remote else length
    crc = 0
    for bit in bits + [0] * (8 * data_bytes):
        crc = _crc_step(crc, bit)
    last, run, stuffed = 1, 0, 0
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, last, run = stuffed + 1, 1 - bit, 1
    total = len(bits) + 8 * data_bytes + 15 + _TRAILER_BITS
    header = _HEADERS[five] = data_bytes, total, crc, stuffed << 3 | last << 2 | run - 1
    return header


def longest_bits(data_bytes: int) -> int:
    """Bits of a standard data frame with the most stuffing, one after each four of the first 34 + 8·n; interframe
    space not included."""
    return 44 + 8 * data_bytes + (33 + 8 * data_bytes) // 4


def frame_bits(raw: bytes) -> int:
    """Bits from start of frame to end of frame, stuff bits included, interframe space not.

    Args:
        raw: one ``struct can_frame``.
    """
    five = raw[:5]
    data_bytes, bits, crc, state = _HEADERS.get(five) or _header(five)
    if data_bytes == 8:
        a, b, c, d = _FOUR_WORDS(raw)
        crc ^= _CRC_16[6][a] ^ _CRC_16[4][b] ^ _CRC_16[2][c] ^ _CRC_16[0][d]
        first = _STUFF_16[state & 7][a]
        second = _STUFF_16[first & 7][b]
        third = _STUFF_16[second & 7][c]
        fourth = _STUFF_16[third & 7][d]
        last = _STUFF_15[fourth & 7][crc]
        stuffed = (state >> 3) + (first >> 3) + (second >> 3) + (third >> 3) + (fourth >> 3) + (last >> 3)
        return bits + stuffed
    stuffed = state >> 3
    after = data_bytes
    for word in _WORDS[data_bytes](raw):
        if after > 1:
            after -= 2
            crc ^= _CRC_16[after][word]
            state = _STUFF_16[state & 7][word]
        else:
            crc ^= _CRC_8[word]
            state = _STUFF_8[state & 7][word]
        stuffed += state >> 3
    return bits + stuffed + (_STUFF_15[state & 7][crc] >> 3)
