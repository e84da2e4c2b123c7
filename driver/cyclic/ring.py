"""The ring in shared memory through which the loop hands out its cycles: one producer, any number of readers.

The producer never waits for a reader in wall-clock time. A reader keeps a cursor of its own and is told
how many cycles it lost when the producer overtook it. In lockstep, where time can stand still, the producer
waits for the one reader that registered as the recorder.

Consistency: a slot's sequence number is zeroed before the slot is rewritten and set after; the head is moved
last. Sequence numbers and head are aligned 8-byte stores, which x86-64 keeps in program order; a reader compares
the sequence number before and after copying and throws away what changed under it.
"""

from __future__ import annotations

import mmap
import os
import struct
import time
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from config import InputError
from config.paths import run_directory
from driver.cyclic.cycle import Cycle, LoopState, WrenchSample
from driver.cyclic.slot import Batch, Serial, SlotCodec

MAGIC = b"ETUDERNG"
VERSION = 1
SLOTS = 4096
"""About four seconds at 1 kHz: longer than any stall of a disk that is not broken."""
PAGE = 4096
HEADER = struct.Struct("<8sIIIIQIQ")
"""magic, version, joints, slots, bytes a slot, period in ns, lockstep, producer's process id."""
# Words of the header page that change, as indices of u64, each on a cache line of its own.
HEAD, RECORDER_PID, RECORDER_CURSOR, ENDED = 16, 24, 32, 40
RECORDER_PATIENCE_S = 30.0


def ring_path(name: str) -> Path:
    """Where the ring called ``name`` of this run directory lives: memory where there is any, else the run directory."""
    run = run_directory()
    shared = Path("/dev/shm")
    if os.access(shared, os.W_OK):
        return shared / f"etude-{os.getuid()}-{zlib.crc32(str(run).encode()):08x}-{name}"
    return run / f"{name}.ring"


def _runs(pid: int) -> bool:
    """Whether the process is there and not merely dead and unburied: a killed child stays in /proc until its parent,
    which may be busy with other things, asks for its end."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"


class RingWriter:
    """The producing end. Only the loop's process holds one."""

    def __init__(self, name: str, joints: int, *, period_ns: int, lockstep: bool, slots: int = SLOTS) -> None:
        self.path = ring_path(name)
        self.codec = SlotCodec(joints)
        self.lockstep = lockstep
        self._slots, self._slot_bytes = slots, self.codec.slot_bytes
        partial = self.path.with_name(self.path.name + ".new")
        partial.unlink(missing_ok=True)
        fd = os.open(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        try:
            os.ftruncate(fd, PAGE + slots * self._slot_bytes)
            self._map = mmap.mmap(fd, 0)
        finally:
            os.close(fd)
        self._bytes = memoryview(self._map)
        self._words = self._bytes.cast("Q")
        HEADER.pack_into(
            self._map, 0, MAGIC, VERSION, joints, slots, self._slot_bytes, period_ns, int(lockstep), os.getpid()
        )
        self._head = 0
        # A reader finds either the old ring or this one complete; readers of the old one keep its memory.
        partial.rename(self.path)

    @property
    def head(self) -> int:
        """Cycles published so far."""
        return self._head

    def publish(
        self,
        index: int,
        time_ns: int,
        late_ns: int,
        state: int,
        run: int,
        valid: int,
        values: Sequence[float],
        wrench: WrenchSample | None,
        frames: Sequence[Batch],
        serial: Sequence[Serial] = (),
        events: Sequence[str] = (),
    ) -> None:
        """Publish one cycle. ``valid`` has bit i set for a fresh joint i; ``values`` is 7·joints numbers:
        q, dq, tau, q_d, dq_d, tau_command, tau_ff, each over all joints.

        What does not fit in the slot (a burst of configuration frames) comes with the next cycles; nothing is dropped.
        """
        head = self._head
        if self.lockstep and head - self._words[RECORDER_CURSOR] >= self._slots and self._words[RECORDER_PID]:
            self._wait_for_recorder()
        start = PAGE + (head % self._slots) * self._slot_bytes
        word = start >> 3
        self._words[word] = 0
        self.codec.encode(
            self._bytes, start, index, time_ns, late_ns, state, run, valid, values, wrench, frames, serial, events
        )
        self._head = head = head + 1
        self._words[word] = head
        self._words[HEAD] = head

    def _wait_for_recorder(self) -> None:
        deadline = time.monotonic() + RECORDER_PATIENCE_S
        while self._head - self._words[RECORDER_CURSOR] >= self._slots:
            pid = self._words[RECORDER_PID]
            if pid == 0 or not _runs(pid) or time.monotonic() > deadline:
                self._words[RECORDER_PID] = 0
                return
            time.sleep(0.0005)

    def close(self) -> None:
        """Tell the readers that no more will come, and take the name away; they keep what they have mapped."""
        self._words[ENDED] = 1
        self._words.release()
        self._bytes.release()
        self._map.close()
        self.path.unlink(missing_ok=True)


class Taken(NamedTuple):
    """What a reader got: cycles ``lost`` just before, and raw ``slots`` in order."""

    lost: int
    slots: list[bytes]


class RingReader:
    """One reader with a cursor of its own. It starts at the newest cycle, or with ``from_start`` at the oldest kept."""

    def __init__(self, name: str, *, from_start: bool = False) -> None:
        path = ring_path(name)
        try:
            fd = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        except FileNotFoundError:
            raise InputError(f"ring {name}", "no loop is running under this name", "start the daemon first") from None
        except PermissionError:
            raise InputError(f"ring {name}", "no permission to read it", "join the group of the daemon") from None
        try:
            self._map = mmap.mmap(fd, 0)
        finally:
            os.close(fd)
        magic, version, joints, slots, slot_bytes, period_ns, lockstep, pid = HEADER.unpack_from(self._map)
        if magic != MAGIC or version != VERSION or len(self._map) != PAGE + slots * slot_bytes:
            self._map.close()
            raise InputError(str(path), "is not a ring of this version", "restart the daemon")
        self._words = memoryview(self._map).cast("Q")
        self.codec = SlotCodec(joints)
        self.joints: int = joints
        self.slots: int = slots
        self.period_ns: int = period_ns
        self.lockstep = bool(lockstep)
        self.producer_pid: int = pid
        self._slot_bytes: int = slot_bytes
        self.cursor = max(0, self.head - slots) if from_start else self.head
        self.lost = 0
        self._recorder = False

    @property
    def head(self) -> int:
        """Cycles the producer has published so far."""
        return self._words[HEAD]

    @property
    def ended(self) -> bool:
        """The producer said goodbye, or its process is gone without."""
        return bool(self._words[ENDED]) or not _runs(self.producer_pid)

    def register_recorder(self) -> None:
        """In lockstep the producer waits for this reader from now on. One a ring."""
        self._words[RECORDER_CURSOR] = self.cursor
        self._words[RECORDER_PID] = os.getpid()
        self._recorder = True

    def take(self, limit: int = 256) -> Taken:
        """Raw slots published since the last call, at most ``limit``; never waits. `SlotCodec.decode` reads one."""
        words, slots, size = self._words, self.slots, self._slot_bytes
        head, cursor, taken, lost = words[HEAD], self.cursor, list[bytes](), 0
        # Keep a slot's distance from the producer, which may be rewriting the oldest slot right now.
        if head - cursor >= slots and not (self.lockstep and self._recorder):
            lost = head - cursor - slots + slots // 8
            cursor += lost
        while cursor < head and len(taken) < limit:
            start = PAGE + (cursor % slots) * size
            before = words[start >> 3]
            data = self._map[start : start + self.codec.used_bytes(self._map, start)]
            if before != cursor + 1 or words[start >> 3] != before:
                if taken:
                    break
                lost += 1
            else:
                taken.append(data)
            cursor += 1
        self.cursor = cursor
        self.lost += lost
        if self._recorder:
            words[RECORDER_CURSOR] = cursor
        return Taken(lost, taken)

    def cycles(self, limit: int = 256) -> tuple[int, list[Cycle]]:
        """As `take`, decoded: cycles lost, and the cycles."""
        lost, slots = self.take(limit)
        return lost, [self.codec.decode(slot) for slot in slots]

    def latest(self) -> Cycle | None:
        """The newest cycle, without moving the cursor; None before the first."""
        for _ in range(8):
            head = self.head
            if head == 0:
                return None
            start = PAGE + ((head - 1) % self.slots) * self._slot_bytes
            data = self._map[start : start + self.codec.used_bytes(self._map, start)]
            if self._words[start >> 3] == head:
                return self.codec.decode(data)
        return None

    def close(self) -> None:
        if self._recorder:
            self._words[RECORDER_PID] = 0
        self._words.release()
        self._map.close()

    def __enter__(self) -> RingReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


__all__ = ["Batch", "LoopState", "RingReader", "RingWriter", "Serial", "Taken", "ring_path"]
