"""The exchange of one cycle with all buses: SYNC, feedback, commands; in wall-clock time or in lockstep.

A bus that fails is reported and left alone; the others go on, so that their axes can be brought to rest.
"""

from __future__ import annotations

import select
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from config import Installation
from config.bus_time import feedback_window_ns
from driver.bus.channel import RECEIVE_BYTES, Channel, open_channel
from driver.bus.errors import ChannelClosed, ChannelFault
from driver.bus.frames import FRAME_BYTES, MarkKind, pack_mark
from driver.cia402.pdo import SYNC, PdoCodec
from driver.cyclic.slot import Batch

FEEDBACK_DEADLINE = 0.75
"""Share of the period after which feedback that has not come is missing."""
GRAIN = 0.06
"""Share of the period between two looks for feedback that is late: waking at every frame costs more than it gives."""
LATEST_START = 0.5
"""Share of the period up to which a late cycle still begins; later it is skipped, so two SYNCs are never close."""


class Begun(NamedTuple):
    """A cycle that has begun: the instant of its SYNC, how late it was, and how many cycles were skipped before it."""

    time_ns: int
    late_ns: int
    skipped: int


@dataclass(slots=True)
class BusCount:
    """Traffic of one bus since its channel was opened."""

    sent: int = 0
    received: int = 0
    errors: int = 0


class Exchange(ABC):
    """Channels of all buses of an installation, in its order. Raises InputError when one cannot be opened."""

    def __init__(self, installation: Installation, channels: Sequence[Channel], codec: PdoCodec) -> None:
        self.period_ns = installation.cycle.period_ns
        self.window_ns = feedback_window_ns(installation, codec.mode)
        self.channels = channels
        self.codec = codec
        self.counts = [BusCount() for _ in channels]
        self.batches: list[Batch] = []
        """Frames that passed since `take_batches`."""
        self.faults: list[str] = []
        """What went wrong on buses since the loop last looked; one sentence each."""
        self.dead: set[int] = set()
        """Numbers of the buses that are gone."""
        self._buffers = [bytearray(RECEIVE_BYTES) for _ in channels]

    @property
    @abstractmethod
    def now_ns(self) -> int:
        """Time as the recordings tell it."""

    @abstractmethod
    def begin(self) -> Begun:
        """Wait for the next cycle's instant and start it with a SYNC on every bus."""

    @abstractmethod
    def collect(self) -> None:
        """Wait for the feedback and hand it to the codec; what is not there at the deadline is missing."""

    @abstractmethod
    def command(self, frames: Sequence[bytes | bytearray]) -> None:
        """Send these frames, one block a bus, so that they act at the next SYNC."""

    def take_batches(self) -> list[Batch]:
        batches, self.batches = self.batches, []
        return batches

    def close(self) -> None:
        for channel in self.channels:
            channel.close()

    def _send(self, bus: int, data: bytes | bytearray) -> None:
        try:
            self.channels[bus].send(data)
        except ChannelFault as fault:
            self._fault(bus, fault)

    def _sent(self, bus: int, data: bytes | bytearray, time_ns: int) -> None:
        self.counts[bus].sent += len(data) // FRAME_BYTES
        self.batches.append((bus, True, time_ns, bytes(data)))

    def _drain(self, bus: int, time_ns: int) -> None:
        buffer = self._buffers[bus]
        try:
            end = self.channels[bus].drain(buffer)
        except ChannelFault as fault:
            self._fault(bus, fault)
            return
        self._received(bus, buffer, end, time_ns)

    def _received(self, bus: int, buffer: bytearray, end: int, time_ns: int) -> None:
        if end:
            self.codec.receive(bus, buffer, end)
            self.counts[bus].received += end // FRAME_BYTES
            self.batches.append((bus, False, time_ns, bytes(buffer[:end])))

    def _fault(self, bus: int, fault: ChannelFault) -> None:
        self.counts[bus].errors += 1
        self.faults.append(str(fault))
        if isinstance(fault, ChannelClosed):
            self.dead.add(bus)


class WallClockExchange(Exchange):
    """Cycles at multiples of the period on the monotonic clock; after a stall cycles are skipped, never made up for."""

    def __init__(self, installation: Installation, channels: Sequence[Channel], codec: PdoCodec) -> None:
        super().__init__(installation, channels, codec)
        # Recordings tell calendar time; fixed once, so that a step of the clock never reaches the loop.
        self._epoch_ns = time.time_ns() - time.monotonic_ns()
        self._latest_ns = int(LATEST_START * self.period_ns)
        self._deadline_ns = max(int(FEEDBACK_DEADLINE * self.period_ns), self.window_ns)
        self._next_ns = time.monotonic_ns() + self.period_ns
        self._sync_ns = 0
        self._grain_ns = int(GRAIN * self.period_ns)
        self._bus_at = {channel.fileno(): bus for bus, channel in enumerate(channels)}
        self._poll = select.poll()
        for descriptor in self._bus_at:
            self._poll.register(descriptor, select.POLLIN)

    @property
    def now_ns(self) -> int:
        return time.monotonic_ns() + self._epoch_ns

    def begin(self) -> Begun:
        due = self._next_ns
        wait = due - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait * 1e-9)
        now = time.monotonic_ns()
        skipped = 0
        if now - due > self._latest_ns:
            # Enough whole periods that the next instant lies ahead; the SYNC before it was a long time ago.
            skipped = (now - due) // self.period_ns + 1
            due += skipped * self.period_ns
            time.sleep(max(0, due - now) * 1e-9)
            now = time.monotonic_ns()
        self._next_ns = due + self.period_ns
        self._sync_ns = now
        stamp = now + self._epoch_ns
        codec = self.codec
        looked_at = len(codec.reception.other)
        # What is in the sockets from before is of the last cycle: recorded, but never this one's feedback.
        self._drain_readable(stamp)
        waiting = codec.reception.other[looked_at:]
        codec.begin_cycle(stamp)
        codec.reception.other += waiting
        for bus in range(len(self.channels)):
            if bus not in self.dead:
                self._send(bus, SYNC)
                self._sent(bus, SYNC, stamp)
        return Begun(stamp, now - due, skipped)

    def collect(self) -> None:
        wait = self._sync_ns + self.window_ns - time.monotonic_ns()
        if wait > 0:
            time.sleep(wait * 1e-9)
        deadline = self._sync_ns + self._deadline_ns
        while True:
            now = time.monotonic_ns()
            self._drain_readable(now + self._epoch_ns)
            if self.codec.complete or now >= deadline or self.dead:
                return
            time.sleep(min(self._grain_ns, max(0, deadline - now)) * 1e-9)

    def _drain_readable(self, stamp: int) -> None:
        for descriptor, _ in self._poll.poll(0):
            bus = self._bus_at[descriptor]
            if bus not in self.dead:
                self._drain(bus, stamp)
                if bus in self.dead:
                    self._poll.unregister(descriptor)

    def command(self, frames: Sequence[bytes | bytearray]) -> None:
        stamp = self.now_ns
        for bus, data in enumerate(frames):
            if data and bus not in self.dead:
                self._send(bus, data)
                self._sent(bus, data, stamp)


class LockstepExchange(Exchange):
    """Virtual time, moved by our ticks (docs/architecture.md, "The local bus")."""

    def __init__(self, installation: Installation, channels: Sequence[Channel], codec: PdoCodec) -> None:
        super().__init__(installation, channels, codec)
        self._now_ns = max(channel.hello_ns or 0 for channel in channels)
        self._pending: list[bytes] = [b"" for _ in channels]

    @property
    def now_ns(self) -> int:
        return self._now_ns

    def begin(self) -> Begun:
        # Cycles stand on multiples of the period, wherever another host has left the time.
        start = self._now_ns - self._now_ns % self.period_ns + self.period_ns
        self._now_ns = start
        self.codec.begin_cycle(start)
        ticks = pack_mark(MarkKind.TICK, start) + SYNC + pack_mark(MarkKind.TICK, start + self.window_ns)
        # The first bus last: its ticks move time, and everything of the other buses must be there by then.
        for bus in range(len(self.channels) - 1, -1, -1):
            self._send(bus, self._pending[bus] + ticks)
            self._sent(bus, SYNC, start)
            self._pending[bus] = b""
        return Begun(start, 0, 0)

    def collect(self) -> None:
        end_ns = self._now_ns + self.window_ns
        for bus, channel in enumerate(self.channels):
            buffer = self._buffers[bus]
            try:
                end = channel.wait_mark(end_ns, buffer)
            except ChannelFault as fault:
                self._fault(bus, fault)
                self.dead.add(bus)
                continue
            earlier = channel.earlier
            if earlier > 0:
                # From before the SYNC: what feedback is among it is of the last cycle, and no news.
                late = bytes(buffer[:earlier])
                self.codec.receive_late(bus, late)
                self.counts[bus].received += earlier // FRAME_BYTES
                self.batches.insert(0, (bus, False, self._now_ns, late))
                buffer, end = buffer[earlier:end], end - earlier
            self._received(bus, buffer, end, end_ns)
        self._now_ns = end_ns

    def command(self, frames: Sequence[bytes | bytearray]) -> None:
        for bus, data in enumerate(frames):
            self._pending[bus] += bytes(data)
            self._sent(bus, data, self._now_ns)

    @property
    def serial_bytes(self) -> dict[int, int]:
        """How many bytes each sensor's line had carried altogether at the end of `collect`, by sensor number."""
        return self.channels[0].serial_bytes

    def look(self) -> dict[int, int]:
        """How many bytes each sensor's line has carried by now, without moving time: a tick to now.

        No frame passes while time stands; the other buses' marks come before the first one's.
        """
        try:
            self.channels[0].tick(self._now_ns)
            self.channels[0].wait_mark(self._now_ns, self._buffers[0])
            for channel, buffer in zip(self.channels[1:], self._buffers[1:], strict=True):
                channel.drain(buffer)
        except ChannelFault as fault:
            self._fault(0, fault)
        return self.serial_bytes


def open_channels(installation: Installation) -> list[Channel]:
    """All channels of an installation; raises InputError, with none left open, when one cannot be opened."""
    channels: list[Channel] = []
    try:
        channels.extend(open_channel(bus.channel) for bus in installation.bus)
    except BaseException:
        for channel in channels:
            channel.close()
        raise
    return channels


def open_exchange(installation: Installation, codec: PdoCodec, *, lockstep: bool) -> Exchange:
    """The exchange over freshly opened channels."""
    channels = open_channels(installation)
    return (LockstepExchange if lockstep else WallClockExchange)(installation, channels, codec)
