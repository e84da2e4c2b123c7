"""One cycle as bytes: the layout of a slot of the ring.

A slot is a fixed part (numbers) and a tail of raw CAN frames, serial bytes and sentences in the order they came.
"""

from __future__ import annotations

import math
import mmap
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

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


Batch = tuple[int, bool, int, bytes]
"""CAN frames of one bus that passed the wire at one time: (bus number, sent by the host, time in ns, k·16 bytes of
struct can_frame). A plain tuple, because the loop makes a dozen a cycle."""
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

    def split(
        self, room: int, frames: Sequence[Batch], serial: Sequence[Serial], events: Sequence[str]
    ) -> tuple[list[Batch], list[Serial], list[str]]:
        """What fits in ``room`` bytes of a slot's tail, in order; the rest is late."""
        fits: tuple[list[Batch], list[Serial], list[str]] = [], [], []
        for k, (bus, sent, when, data) in enumerate(frames):
            size = max(0, min(len(data), (room - BATCH_HEAD.size) // FRAME * FRAME))
            if size:
                fits[0].append((bus, sent, when, data[:size]))
                room -= BATCH_HEAD.size + size
            if size < len(data):
                self.frames = [(bus, sent, when, data[size:]), *frames[k + 1 :]]
                break
        for k, (sensor, line) in enumerate(serial):
            size = max(0, min(len(line), room - SERIAL_HEAD.size))
            if size:
                fits[1].append((sensor, line[:size]))
                room -= SERIAL_HEAD.size + size
            if size < len(line):
                self.serial = [(sensor, line[size:]), *serial[k + 1 :]]
                break
        for k, sentence in enumerate(events):
            size = EVENT_HEAD.size + len(sentence.encode()[:EVENT_BYTES])
            if size > room:
                self.events = list(events[k:])
                break
            fits[2].append(sentence)
            room -= size
        return fits


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
        *,
        split: bool = False,
    ) -> None:
        """Write one cycle at ``start``, all but its sequence number (the first 8 bytes). ``split``: what is late
        was set aside just now and does not belong here."""
        at, end = start + self._tail, start + self.slot_bytes
        if self._late.waiting and not split:
            frames, serial, events = self._late.before(frames, serial, events)
        parts: list[bytes] = []
        head = BATCH_HEAD.pack
        for bus, sent, when, data in frames:
            parts.append(head(bus, sent, len(data) // FRAME, 0, when))
            parts.append(data)
        for sensor, line in serial:
            parts.append(SERIAL_HEAD.pack(sensor, 0, len(line)))
            parts.append(line)
        for sentence in events:
            text = sentence.encode()[:EVENT_BYTES]
            parts.append(EVENT_HEAD.pack(len(text)))
            parts.append(text)
        tail = b"".join(parts)
        if at + len(tail) > end:
            frames, serial, events = self._late.split(end - at, frames, serial, events)
            self.encode(
                buffer, start, index, time_ns, late_ns, state, run, valid, values, wrench, frames, serial, events,
                split=True,
            )  # fmt: skip
            return
        buffer[at : at + len(tail)] = tail
        at += len(tail)
        batches, lines, sentences = len(frames), len(serial), len(events)
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
