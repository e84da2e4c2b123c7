"""Streams of wrench sensors, spoilt: real frames with bytes flipped, dropped, spliced and doubled, seeded."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from config.schema import WrenchSensor
from driver.cyclic.cycle import WrenchSample
from driver.wrench import make_parser

Kind = Literal["bota", "robotiq"]
Bytes = NDArray[np.uint8]
SPOILT_SHARE = 1 / 16
"""Frames at which something happens to the stream."""
START_NS = 1_700_000_000_000_000_000
PIECE_BYTES = 200
"""Longest piece that arrives at once."""
SENSORS = {
    "bota": WrenchSensor(
        name="wrist", protocol="bota", port="pty:wrist", frame="tool", rate_hz=1000, range_n=500, range_nm=20
    ),
    "robotiq": WrenchSensor(
        name="wrist", protocol="robotiq", port="pty:wrist", frame="tool", rate_hz=100, range_n=300, range_nm=30,
        baud=19200, stale_ms=80,
    ),
}  # fmt: skip


def _table(polynomial: int) -> NDArray[np.uint16]:
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = np.where(table & 1, table >> 1 ^ polynomial, table >> 1).astype(np.uint16)
    return table


def checksums(rows: Bytes, polynomial: int, inverted: bool) -> NDArray[np.uint16]:
    """Reflected CRC-16 of each row, start FFFF; written apart from the driver's."""
    table, crc = _table(polynomial), np.full(len(rows), 0xFFFF, np.uint16)
    for column in rows.T:
        crc = crc >> 8 ^ table[(crc ^ column) & 0xFF]
    return ~crc if inverted else crc


def frames_of(kind: Kind, number: int, rng: np.random.Generator) -> Bytes:
    """``number`` frames as rows, of random wrenches within the sensor's range, some with header bytes inside."""
    if kind == "bota":
        rows = np.zeros((number, 37), np.uint8)
        rows[:, 0] = 0xAA
        rows[:, 3:27] = rng.normal(scale=[80, 80, 80, 3, 3, 3], size=(number, 6)).astype("<f4").view(np.uint8)
        rows[:, 27:31] = (1000 * np.arange(number) % 2**32).astype("<u4")[:, None].view(np.uint8)
        rows[:, 31:35] = np.frombuffer(struct.pack("<f", 25.0), np.uint8)
        rows[::7, 3] = 0xAA
        rows[:, 35:] = checksums(rows[:, 1:35], 0x8408, True)[:, None].view(np.uint8)
        return rows
    rows = np.zeros((number, 16), np.uint8)
    rows[:, :2] = 0x20, 0x4E
    rows[:, 2:14] = rng.integers(-29_000, 29_000, (number, 6)).astype("<i2").view(np.uint8)
    rows[::7, 2:4] = 0x20, 0x4E
    rows[:, 14:] = checksums(rows[:, :14], 0xA001, False)[:, None].view(np.uint8)
    return rows


def wrenches_in(kind: Kind, rows: Bytes) -> NDArray[np.float64]:
    """rows × 6: what the sensor measured, N and N·m."""
    if kind == "bota":
        return np.ascontiguousarray(rows[:, 3:27]).view("<f4").astype(float)
    return np.ascontiguousarray(rows[:, 2:14]).view("<i2") / np.array([100, 100, 100, 1000, 1000, 1000])


@dataclass
class Spoilt:
    """A spoilt stream: its bytes, and which of the frames went into it whole, with nothing strange around them."""

    data: bytes
    whole: NDArray[np.bool_]
    """Neither the frame nor its place was touched."""
    ends: NDArray[np.int64]
    """Where each frame ends in ``data``."""


def spoil(rows: Bytes, rng: np.random.Generator) -> Spoilt:
    """Frames of the sensor after a bad line."""
    count, size = rows.shape
    flat = rows.tobytes()
    fate = np.where(rng.random(count) < SPOILT_SHARE, rng.integers(1, 8, count), 0)
    pieces, length, ends = list[bytes](), 0, np.zeros(count, np.int64)
    for k in range(count):
        frame = flat[k * size : (k + 1) * size]
        if fate[k]:
            frame = _happened(int(fate[k]), frame, flat, k, rng)
        pieces.append(frame)
        length += len(frame)
        ends[k] = length
    return Spoilt(b"".join(pieces), fate == 0, ends)


def _happened(fate: int, frame: bytes, flat: bytes, k: int, rng: np.random.Generator) -> bytes:
    size = len(frame)
    at, many = int(rng.integers(size)), int(rng.integers(1, 12))
    if fate == 1:  # one bit
        return frame[:at] + bytes([frame[at] ^ 1 << int(rng.integers(8))]) + frame[at + 1 :]
    if fate == 2:  # any bits of some bytes in a row
        return (frame[:at] + rng.bytes(many) + frame[at + many :])[:size]
    if fate == 3:  # bytes lost
        return frame[:at] + frame[at + many :]
    if fate == 4:  # bytes doubled
        return frame[: at + many] + frame[at:]
    earlier = max(0, k - int(rng.integers(1, 50))) * size
    if fate == 5:  # a buffer overtaken: the rest is of an older frame
        return frame[:at] + flat[earlier + at : earlier + size]
    if fate == 6:  # noise between two frames, beginning like a frame
        return frame + frame[:2] + rng.bytes(3 * many)
    return frame + flat[earlier : earlier + size]  # a buffer sent again


@dataclass
class Judged:
    """What a parser made of a spoilt stream."""

    fed: int = 0
    spoilt: int = 0
    good: int = 0
    wrong: int = 0
    """Fresh samples that differ from every frame sent."""
    again: int = 0
    """Fresh samples of frames that had already been delivered."""
    slow: list[int] = field(default_factory=list)
    """Whole frames that were not delivered although the one before was whole too."""


def judge(kind: Kind, size: int, seed: int) -> Judged:
    """Feed at least ``size`` spoilt bytes to the driver's parser, in pieces of any length."""
    rng = np.random.default_rng(seed)
    frame_bytes, period_ns = (37, 1_000_000) if kind == "bota" else (16, 10_000_000)
    rows = frames_of(kind, -(-size // frame_bytes), rng)
    spoilt = spoil(rows, rng)
    samples = _parsed(kind, spoilt, period_ns, rng)
    numbers = {tuple(w): k for k, w in enumerate(wrenches_in(kind, rows).tolist())}
    result = Judged(len(spoilt.data), int((~spoilt.whole).sum()))
    delivered = np.zeros(len(rows), bool)
    for sample in samples:
        number = numbers.get(sample.values)
        if not sample.fresh:
            continue
        result.good += 1
        if number is None:
            result.wrong += 1
        else:
            result.again += bool(delivered[number])
            delivered[number] = True
    due = spoilt.whole[1:] & spoilt.whole[:-1]
    result.slow = (1 + np.flatnonzero(due & ~delivered[1:])).tolist()
    return result


def _parsed(kind: Kind, spoilt: Spoilt, period_ns: int, rng: np.random.Generator) -> list[WrenchSample]:
    parser = make_parser(SENSORS[kind])
    samples, at = list[WrenchSample](), 0
    cuts = np.cumsum(rng.integers(1, PIECE_BYTES, 2 + 4 * len(spoilt.data) // PIECE_BYTES))
    arrived = START_NS + np.searchsorted(spoilt.ends, cuts) * period_ns
    for cut, now_ns in zip(cuts.tolist(), arrived.tolist(), strict=True):
        samples += parser.feed(spoilt.data[at:cut], now_ns)
        at = cut
        if at >= len(spoilt.data):
            break
    return samples
