"""One cycle as bytes: the layout of a slot of the ring.

A slot is a fixed part (numbers) and a tail of raw CAN frames, serial bytes and sentences in the order they came.
"""

from __future__ import annotations

import math
import mmap
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from driver.cyclic.cycle import Cycle, LoopState, RawFrame, WrenchSample

COLUMNS = 7
"""q, dq, tau, q_d, dq_d, tau_command, tau_ff: one number a joint each."""
FRAME = 16
EVENT_BYTES = 512
"""A sentence is cut here."""
TAIL_BYTES = 2560
BATCH_HEAD = struct.Struct("<BBHIq")
SERIAL_HEAD = struct.Struct("<HHI")
EVENT_HEAD = struct.Struct("<H")
SEQUENCE_AND_USED = struct.Struct("<QI")
NO_WRENCH = (math.nan,) * 6
WRENCH_PRESENT, WRENCH_FRESH = 1, 2


class Batch(NamedTuple):
    """CAN frames of one bus that passed the wire at one time: ``data`` is k·16 bytes of struct can_frame."""

    bus: int
    sent: bool
    time_ns: int
    data: bytes


Buffer = bytes | memoryview | mmap.mmap
Serial = tuple[int, bytes]
"""(sensor number, bytes of its line)."""


@dataclass(slots=True)
class _Late:
    """What did not fit in its own slot, in order."""

    frames: list[Batch] = field(default_factory=list)
    serial: list[Serial] = field(default_factory=list)
    events: list[str] = field(default_factory=list)

    @property
    def waiting(self) -> bool:
        return bool(self.frames or self.serial or self.events)

    def before(
        self, frames: Sequence[Batch], serial: Sequence[Serial], events: Sequence[str]
    ) -> tuple[list[Batch], list[Serial], list[str]]:
        """All that is late with the new behind it; nothing is late any more."""
        everything = self.frames + list(frames), self.serial + list(serial), self.events + list(events)
        self.frames, self.serial, self.events = [], [], []
        return everything


class SlotCodec:
    """Encoder and decoder of the slots of an arm with ``joints`` joints.

    The encoder keeps what did not fit, in order, for the next slots.
    """

    def __init__(self, joints: int, tail_bytes: int = TAIL_BYTES) -> None:
        self.joints = joints
        # sequence, bytes used, state, run, valid, late, counts of the tail's parts, index, time, wrench, columns
        self.fixed = struct.Struct(f"<IIIIq HHHBB Q q 6dq i4x {COLUMNS * joints}d")
        self._tail = 8 + self.fixed.size
        self.slot_bytes = (self._tail + tail_bytes + 63) // 64 * 64
        self._late = _Late()

    def used_bytes(self, buffer: Buffer, start: int) -> int:
        """Length of the slot at ``start``, bounded by the slot's size whatever the bytes say."""
        used: int = SEQUENCE_AND_USED.unpack_from(buffer, start)[1]
        return min(used, self.slot_bytes)

    def encode(
        self,
        buffer: memoryview,
        start: int,
        index: int,
        time_ns: int,
        late_ns: int,
        state: int,
        run: int,
        valid: int,
        values: Sequence[float],
        wrench: WrenchSample | None,
        frames: Sequence[Batch],
        serial: Sequence[Serial],
        events: Sequence[str],
    ) -> None:
        """Write one cycle at ``start``, all but its sequence number (the first 8 bytes)."""
        at, end = start + self._tail, start + self.slot_bytes
        if self._late.waiting:
            frames, serial, events = self._late.before(frames, serial, events)
        batches = lines = sentences = 0
        for k, batch in enumerate(frames):
            data = batch.data
            room = (end - at - 16) // FRAME * FRAME
            if len(data) > room:
                self._late.frames += [batch._replace(data=bytes(data[max(0, room) :])), *frames[k + 1 :]]
                if room <= 0:
                    break
                data = data[:room]
            size = len(data)
            BATCH_HEAD.pack_into(buffer, at, batch.bus, batch.sent, size // FRAME, 0, batch.time_ns)
            at += 16
            buffer[at : at + size] = data
            at += size
            batches += 1
            if self._late.frames:
                break
        for k, (sensor, line) in enumerate(serial):
            room = end - at - 8
            if len(line) > room:
                self._late.serial += [(sensor, line[max(0, room) :]), *serial[k + 1 :]]
                if room <= 0:
                    break
                line = line[:room]
            size = len(line)
            SERIAL_HEAD.pack_into(buffer, at, sensor, 0, size)
            at += 8
            buffer[at : at + size] = line
            at += size
            lines += 1
            if self._late.serial:
                break
        for k, sentence in enumerate(events):
            text = sentence.encode()[:EVENT_BYTES]
            size = len(text)
            if at + 2 + size > end:
                self._late.events += events[k:]
                break
            EVENT_HEAD.pack_into(buffer, at, size)
            at += 2
            buffer[at : at + size] = text
            at += size
            sentences += 1
        if wrench is None:
            six, status, stamp, flags = NO_WRENCH, 0, 0, 0
        else:
            six, status, stamp = wrench.values, wrench.status, wrench.stamp_ns
            flags = WRENCH_PRESENT | (WRENCH_FRESH if wrench.fresh else 0)
        self.fixed.pack_into(
            buffer, start + 8, at - start, state, run, valid, late_ns, batches, lines, sentences, flags, 0,
            index, time_ns, *six, stamp, status, *values,
        )  # fmt: skip

    def decode(self, slot: bytes) -> Cycle:
        """The cycle of one slot as `RingReader.take` gives it."""
        n = self.joints
        fields = self.fixed.unpack_from(slot, 8)
        _, state, run, valid, late_ns, batches, lines, sentences, flags, _, index, time_ns = fields[:12]
        six, stamp, status, values = fields[12:18], fields[18], fields[19], fields[20:]
        at = self._tail
        frames: list[RawFrame] = []
        for _ in range(batches):
            bus, sent, count, _, when = BATCH_HEAD.unpack_from(slot, at)
            at += 16
            frames += [
                RawFrame(bus, when, bool(sent), slot[k : k + FRAME]) for k in range(at, at + count * FRAME, FRAME)
            ]
            at += count * FRAME
        serial: list[Serial] = []
        for _ in range(lines):
            sensor, _, size = SERIAL_HEAD.unpack_from(slot, at)
            at += 8
            serial.append((sensor, slot[at : at + size]))
            at += size
        events: list[str] = []
        for _ in range(sentences):
            (size,) = EVENT_HEAD.unpack_from(slot, at)
            at += 2
            events.append(slot[at : at + size].decode(errors="replace"))
            at += size
        wrench = WrenchSample(six, status, stamp, bool(flags & WRENCH_FRESH)) if flags & WRENCH_PRESENT else None
        q, dq, tau, q_d, dq_d, tau_command, tau_ff = (values[k * n : (k + 1) * n] for k in range(COLUMNS))
        return Cycle(
            index=index,
            time_ns=time_ns,
            state=LoopState(state),
            late_ns=late_ns,
            valid=tuple(bool(valid >> i & 1) for i in range(n)),
            q=q,
            dq=dq,
            tau=tau,
            q_d=q_d,
            dq_d=dq_d,
            tau_command=tau_command,
            tau_ff=tau_ff,
            run=run,
            wrench=wrench,
            frames=tuple(frames),
            serial=tuple(serial),
            events=tuple(events),
        )
