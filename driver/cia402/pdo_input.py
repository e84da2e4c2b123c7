"""TPDOs of one bus into a flat list of raw values: all by one ``struct`` as they usually come, else by table."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from operator import itemgetter

from config.schema import Drive
from driver.bus.frames import FRAME, FRAME_BYTES
from driver.cia402.mapping import PdoMap

CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i"}
"""`struct` codes of the mapped objects' types."""
HEAD = "IB3x"
"""Identifier and length of a can_frame."""


@dataclass(slots=True)
class Reception:
    """What else a bus carried: frames that are no TPDO of ours, and TPDOs that are not as mapped."""

    other: list[tuple[int, int, bytes]] = field(default_factory=list)
    """(bus number, identifier with flags, data): emergencies, heartbeats, SDO answers, error frames."""
    malformed: list[tuple[int, int, int]] = field(default_factory=list)
    """(bus number, identifier, length) of TPDOs of the wrong length: never taken for feedback."""
    doubled: int = 0
    """TPDOs that came a second time within the cycle."""


@dataclass(slots=True)
class _Tpdo:
    """Where the values of one TPDO go in the flat list of raw values."""

    unpack: struct.Struct
    length: int
    values: slice
    bit: int


class BusInput:
    """The TPDOs of one bus. ``mask`` has a bit for each; they stand in ``raw`` behind one another."""

    def __init__(self, bus: int, tpdos: Sequence[tuple[PdoMap, Drive]], raw: list[int], first_bit: int) -> None:
        """``tpdos`` in the order of their identifiers, which is that of a bus that all drives wait for. Room for
        their values is added to ``raw``; bits are counted on from ``first_bit``."""
        self.bus, self._raw = bus, raw
        self._table: dict[int, _Tpdo] = {}
        self._first = len(raw)
        layout, heads, values, expected = "<", list[int](), list[int](), list[int]()
        for pdo, drive in tpdos:
            start, bit = len(raw), first_bit << len(self._table)
            raw += [0] * len(pdo.names)
            self._table[pdo.cob_id] = _Tpdo(pdo_struct(pdo, drive), pdo.length, slice(start, len(raw)), bit)
            at = len(heads) + len(values)
            layout += HEAD + pdo_codes(pdo, drive)
            heads += [at, at + 1]
            values += range(at + 2, at + 2 + len(pdo.names))
            expected += [pdo.cob_id, pdo.length]
        self._last = len(raw)
        self.mask = (first_bit << len(self._table)) - first_bit
        self._whole = struct.Struct(layout)
        self._expected = tuple(expected)
        # An itemgetter of one place gives no tuple, so that a bus without TPDOs never takes the short way.
        self._heads = itemgetter(*heads) if heads else None
        self._values = itemgetter(*values) if len(values) > 1 else None

    def receive(self, buffer: bytearray | memoryview | bytes, end: int, fresh: int, reception: Reception) -> int:
        """Take the frames ``buffer[:end]``; returns ``fresh`` with the bits of the TPDOs that came."""
        size = self._whole.size
        if end >= size and self._heads is not None and self._values is not None and not fresh & self.mask:
            found = self._whole.unpack_from(buffer)
            if self._heads(found) == self._expected:
                self._raw[self._first : self._last] = self._values(found)
                fresh |= self.mask
                return fresh if end == size else self._one_by_one(buffer, size, end, fresh, reception)
        return self._one_by_one(buffer, 0, end, fresh, reception)

    def receive_late(self, frames: bytes, reception: Reception) -> None:
        """Take frames that came too late for their cycle: their feedback is passed over."""
        for can_id, length, data in FRAME.iter_unpack(frames):
            if can_id not in self._table:
                reception.other.append((self.bus, can_id, data[: min(length, 8)]))

    def _one_by_one(
        self, buffer: bytearray | memoryview | bytes, start: int, end: int, fresh: int, reception: Reception
    ) -> int:
        table, raw = self._table, self._raw
        with memoryview(buffer) as view, view[start : end - end % FRAME_BYTES] as frames:
            for can_id, length, data in FRAME.iter_unpack(frames):
                entry = table.get(can_id)
                if entry is None:
                    reception.other.append((self.bus, can_id, data[: min(length, 8)]))
                elif length != entry.length:
                    reception.malformed.append((self.bus, can_id, length))
                else:
                    raw[entry.values] = entry.unpack.unpack(data)
                    if fresh & entry.bit:
                        reception.doubled += 1
                    fresh |= entry.bit
        return fresh


def pdo_codes(pdo: PdoMap, drive: Drive) -> str:
    """`struct` codes of the values of one PDO, padded to the 8 data bytes of a can_frame."""
    return "".join(CODES[drive.object(name).type] for name in pdo.names) + f"{8 - pdo.length}x"


def pdo_struct(pdo: PdoMap, drive: Drive) -> struct.Struct:
    """The values of one PDO as a struct over the 8 data bytes of a can_frame."""
    return struct.Struct("<" + pdo_codes(pdo, drive))
