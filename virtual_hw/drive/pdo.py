"""Process data: RPDOs into the object store, TPDOs out of it, each by one precompiled `struct`."""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from operator import itemgetter

from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.objects import Entry, ObjectStore

INVALID = 1 << 31
SYNCHRONOUS_MAX = 240
EVENT_DRIVEN = (254, 255)
_NEVER = 1 << 63
_DUMMIES = {2: ("x", 8), 3: ("2x", 16), 4: ("4x", 32), 5: ("x", 8), 6: ("2x", 16), 7: ("4x", 32)}
"""Dummy entries (CiA 301, 7.4.9.1): bytes of an RPDO that this node leaves to others, by data type index."""


def mapped_entry(store: ObjectStore, mapping: int, *, receive: bool) -> Entry | None:
    """The object that a mapping value names, or None for a dummy.

    Raises:
        SdoAbort: no such object, not mappable this way, or the length is not the object's.
    """
    index, subindex, bits = mapping >> 16, mapping >> 8 & 0xFF, mapping & 0xFF
    if receive and subindex == 0 and index in _DUMMIES and _DUMMIES[index][1] == bits:
        return None
    try:
        entry = store.entry(index, subindex)
    except SdoAbort:
        raise SdoAbort(Abort.NOT_MAPPABLE) from None
    if not (entry.into_rpdo if receive else entry.into_tpdo) or 8 * entry.size != bits:
        raise SdoAbort(Abort.NOT_MAPPABLE)
    return entry


def mapping_layout(store: ObjectStore, mappings: Sequence[int], *, receive: bool) -> tuple[str, list[Entry]]:
    """(`struct` format, entries) of a whole mapping.

    Raises:
        SdoAbort: an object cannot be mapped, or all of them exceed eight bytes.
    """
    code, entries = "", []
    for mapping in mappings:
        entry = mapped_entry(store, mapping, receive=receive)
        if entry is None:
            code += _DUMMIES[mapping >> 16][0]
        else:
            code += entry.format
            entries.append(entry)
    if struct.calcsize("<" + code) > 8:
        raise SdoAbort(Abort.MAPPING_LENGTH)
    return code, entries


class Pdo(ABC):
    """What RPDO and TPDO share: their parameters in the object store.

    `number` counts from 0; communication parameters live at 1400+n or 1800+n, the mapping 200h above.
    """

    receive: bool

    def __init__(self, store: ObjectStore, number: int) -> None:
        base = (0x1400 if self.receive else 0x1800) + number
        self.store, self.number = store, number
        self._parameters = {k: store.slot(base, k) for k in (1, 2, 3, 5) if store.has(base, k)}
        self.mapping_slots = [store.slot(base + 0x200, k) for k in range(9)]

    @abstractmethod
    def configure(self) -> None:
        """Compile the parameters and mapping that stand in the store."""

    def parameter(self, subindex: int) -> int:
        slot = self._parameters.get(subindex)
        return 0 if slot is None else self.store.values[slot]

    @property
    def valid(self) -> bool:
        return not self.parameter(1) & INVALID

    @property
    def can_id(self) -> int:
        return self.parameter(1) & 0x7FF

    @property
    def transmission(self) -> int:
        return self.parameter(2)

    @property
    def mappings(self) -> list[int]:
        values = self.store.values
        return [values[slot] for slot in self.mapping_slots[1 : 1 + values[self.mapping_slots[0]]]]


class ReceivePdo(Pdo):
    """One RPDO. A synchronous one keeps the newest frame until the SYNC."""

    receive = True

    def __init__(self, store: ObjectStore, number: int, length_error: Callable[[int], None]) -> None:
        """
        Args:
            length_error: told -1 (too short, ignored), 1 (too long, the rest ignored) or 0 (right).
        """
        super().__init__(store, number)
        self._length_error = length_error
        self._wrong_length = False
        self.pending: bytes | None = None
        self.deadline_ns = _NEVER

    def configure(self) -> None:
        """Compile the parameters and mapping that stand in the store."""
        code, entries = mapping_layout(self.store, self.mappings, receive=True)
        self.size = struct.calcsize("<" + code)
        self._unpack = struct.Struct(f"<8x{code}{8 - self.size}x").unpack
        self._slots = [entry.slot for entry in entries]
        self.indices = frozenset(entry.index for entry in entries)
        self.synchronous = self.transmission <= SYNCHRONOUS_MAX
        self.timeout_ns = self.parameter(5) * 1_000_000
        self.deadline_ns = _NEVER
        self.pending = None

    @property
    def in_order(self) -> bool:
        """Whether its last frame was as long as its mapping."""
        return not self._wrong_length

    def accept(self, now_ns: int, raw: bytes) -> bool:
        """Take a frame in; False when it is too short to be used."""
        if raw[4] != self.size:
            self._wrong_length = True
            self._length_error(-1 if raw[4] < self.size else 1)
            if raw[4] < self.size:
                return False
        elif self._wrong_length:
            self._wrong_length = False
            self._length_error(0)
        self.pending = raw
        if self.timeout_ns:
            self.deadline_ns = now_ns + self.timeout_ns
        return True

    def apply(self) -> None:
        """Write the pending frame's values to their objects."""
        raw = self.pending
        if raw is None:
            return
        self.pending = None
        values = self.store.values
        for slot, value in zip(self._slots, self._unpack(raw), strict=True):
            values[slot] = value


class TransmitPdo(Pdo):
    """One TPDO: synchronous (on an event, or every n-th SYNC), or event-driven with inhibit time and event timer."""

    receive = False

    def __init__(self, store: ObjectStore, number: int, send: Callable[[bytes], object]) -> None:
        super().__init__(store, number)
        self._send = send

    def configure(self) -> None:
        """Compile the parameters and mapping that stand in the store."""
        code, entries = mapping_layout(self.store, self.mappings, receive=False)
        self.size = size = struct.calcsize("<" + code)
        self._layout = struct.Struct(f"<IB3x{code}{8 - size}x")
        self._head = (self.can_id, size)
        slots = [entry.slot for entry in entries]
        # An itemgetter of one slot gives no tuple: the last slot twice, cut off by the slice, keeps one form.
        self._pick = itemgetter(*slots, slots[-1], slots[-1]) if slots else None
        self._count = len(slots)
        self._measured = [
            (entry.slot, self.store.sources[entry.index, entry.subindex])
            for entry in entries
            if (entry.index, entry.subindex) in self.store.sources
        ]
        self.synchronous = self.transmission <= SYNCHRONOUS_MAX
        self.event_driven = self.transmission in EVENT_DRIVEN
        self._inhibit_ns = self.parameter(3) * 100_000
        self._period_ns = self.parameter(5) * 1_000_000
        self._every = self.transmission
        self._syncs = 0
        self._told: bytes | None = None
        self._told_ns = -_NEVER

    @property
    def every_sync(self) -> bool:
        """Whether it is sent at each SYNC, whatever happens."""
        return self._every == 1

    @property
    def due(self) -> bool:
        """Whether the next SYNC has it sent, of one that is sent at every n-th."""
        return self._syncs + 1 >= self._every

    def pass_sync(self) -> None:
        """A SYNC at which it is not due has come."""
        self._syncs += 1

    def on_sync(self) -> None:
        """Send, where this SYNC asks for it."""
        if self._every == 0:
            raw = self.frame()
            if raw != self._told:
                self._told = raw
                self._send(raw)
            return
        self._syncs += 1
        if self._syncs >= self._every:
            self._syncs = 0
            self._send(self.frame())

    def poll(self, now_ns: int) -> None:
        """Event-driven transmission, on the firmware's tick."""
        since = now_ns - self._told_ns
        if since < self._inhibit_ns:
            return
        raw = self.frame()
        if raw != self._told or (self._period_ns and since >= self._period_ns):
            self._told, self._told_ns = raw, now_ns
            self._send(raw)

    def frame(self) -> bytes:
        """The frame as it would be sent now."""
        values = self.store.values
        for slot, source in self._measured:
            values[slot] = source()
        if self._pick is None:
            return self._layout.pack(*self._head)
        return self._layout.pack(*self._head, *self._pick(values)[: self._count])
