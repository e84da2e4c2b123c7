"""One CAN bus in simulated time: transmit queues, arbitration by identifier, bit times, delivery."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from heapq import heapify, heappop, heappush

from virtual_hw.bus.frames import INTERFRAME_BITS, arbitration_key, frame_bits, longest_bits

MOST_IDENTIFIERS = 4096
FrameHandler = Callable[[int, bytes], None]
"""Called with the time in ns and the ``struct can_frame``."""
Tamper = Callable[["Bus", bytes, "Controller"], bool]
"""Called with a frame whose transmission has ended and its sender; True keeps it from being delivered."""


class Controller:
    """One CAN controller on a bus: a finite transmit queue, and optionally an ear for every frame of the others."""

    __slots__ = ("deaf", "depth", "hear", "lost", "queued")

    def __init__(self, depth: int, hear: FrameHandler | None = None) -> None:
        self.depth = depth
        self.hear = hear
        self.queued = 0
        self.deaf = False
        """Whether nothing of the bus reaches it."""
        self.lost = 0
        """Frames dropped because the transmit queue was full."""


class _Identifier:
    """What every frame with these four identifier bytes shares: its place in arbitration, and who listens for it."""

    __slots__ = ("handlers", "key")

    def __init__(self, key: int) -> None:
        self.key = key
        self.handlers: list[tuple[Controller, FrameHandler]] = []


class Bus:
    """A bus that carries one frame after the other, the lowest waiting identifier first.

    Every queued frame of every controller takes part in the arbitration; frames with one identifier keep their
    order. A frame is delivered to all other controllers when its end of frame has passed.
    """

    def __init__(self, name: str, bitrate: int, start_ns: int) -> None:
        """
        Args:
            name: the installation's name of the bus.
            bitrate: bit/s.
            start_ns: time at which the bus comes to life, ns.
        """
        self.name = name
        self.clock_ns = start_ns
        """Time up to which the bus has been simulated."""
        self._bit_ns = 1e9 / bitrate
        self._free_ns = start_ns
        self._waiting: list[tuple[int, int, bytes, Controller, _Identifier]] = []
        self._sequence = 0
        self._on_wire: tuple[int, bytes, Controller, _Identifier] | None = None
        self._interframe_ns = int(INTERFRAME_BITS * self._bit_ns)
        self._longest_ns = self.longest_ns(8)
        self._ears: list[tuple[Controller, FrameHandler]] = []
        self._identifiers: dict[bytes, _Identifier] = {}
        """By the four bytes of the identifier in a `struct can_frame`."""
        self._at_once = False
        self._block: tuple[int, Sequence[bytes]] | None = None
        """A block on the wire whose exact end nobody has needed yet: its start, and its frames."""
        self.changes = 0
        """Counts what was attached, detached, listened for or ignored."""
        self.tampers: list[Tamper] = []
        """Faults that lay hands on frames."""

    def attach(self, controller: Controller) -> None:
        """Connect a controller; one with an ear hears every frame of the others from now on."""
        self.changes += 1
        if controller.hear is not None:
            self._ears.append((controller, controller.hear))

    def detach(self, controller: Controller) -> None:
        """Disconnect a controller: what it has queued is not sent, what is on the wire ends as it is."""
        self.changes += 1
        self._ears = [entry for entry in self._ears if entry[0] is not controller]
        self._waiting[:] = [entry for entry in self._waiting if entry[3] is not controller]
        heapify(self._waiting)
        controller.queued = 0

    def listen(self, can_id: int, controller: Controller, handler: FrameHandler) -> None:
        """Have ``handler`` called for every frame of others with this identifier (its acceptance filter)."""
        self.changes += 1
        identifier = self._identifier(can_id.to_bytes(4, "little"))
        # A new list: a handler may be added or removed while the old one is being gone through.
        identifier.handlers = [*identifier.handlers, (controller, handler)]

    def ignore(self, can_id: int, controller: Controller, handler: FrameHandler) -> None:
        """Undo a `listen`."""
        self.changes += 1
        identifier = self._identifier(can_id.to_bytes(4, "little"))
        identifier.handlers = [entry for entry in identifier.handlers if entry != (controller, handler)]

    def listeners(self, four: bytes) -> list[tuple[Controller, FrameHandler]]:
        """Who listens for the identifier with these bytes, in the order in which they hear it."""
        return self._identifier(four).handlers

    @property
    def ears(self) -> list[Controller]:
        """Who hears every frame."""
        return [controller for controller, _ in self._ears]

    def _identifier(self, four: bytes) -> _Identifier:
        known = self._identifiers.get(four)
        if known is None:
            if len(self._identifiers) >= MOST_IDENTIFIERS:
                # Only extended identifiers are that many; those without listeners can be met again.
                self._identifiers = {k: v for k, v in self._identifiers.items() if v.handlers}
            known = self._identifiers[four] = _Identifier(arbitration_key(four))
        return known

    def send(self, controller: Controller, raw: bytes) -> bool:
        """Queue a frame at the present time; False when the controller's queue is full and the frame is lost."""
        if self._at_once:
            self._deliver(raw, controller, self._identifier(raw[:4]))
            return True
        if controller.queued >= controller.depth:
            controller.lost += 1
            return False
        controller.queued += 1
        self._sequence += 1
        identifier = self._identifier(raw[:4])
        heappush(self._waiting, (identifier.key, self._sequence, raw, controller, identifier))
        return True

    def exchange_at_once(self, controller: Controller, raw: bytes) -> None:
        """Carry a frame and everything it gives rise to in no time at all, past all queues.

        Lockstep answers configuration traffic so while time stands still.
        """
        self._at_once = True
        try:
            self._deliver(raw, controller, self._identifier(raw[:4]))
        finally:
            self._at_once = False

    def inject(self, controller: Controller, raw: bytes) -> None:
        """Deliver a frame that ``controller`` brings from elsewhere, where its transmission has just ended."""
        self._deliver(raw, controller, self._identifier(raw[:4]))

    def is_free_for(self, last_key: int) -> bool:
        """Whether frames sent now go out at once, back to back, when none is behind ``last_key`` in arbitration."""
        waiting = self._waiting
        return self._on_wire is None and not self.tampers and (not waiting or waiting[0][0] > last_key)

    def carry_block(self, frames: Sequence[bytes]) -> None:
        """Carry these frames from now on, back to back, in this order; who hears them is the caller's affair.

        For a bus that `is_free_for` them. When the block ends is worked out when another frame has to wait for it.
        """
        start_ns = self.clock_ns if self._block is not None else max(self._free_ns, self.clock_ns)
        self._block = start_ns, frames

    def block_ends_ns(self) -> list[int]:
        """When each frame of the last block has been carried."""
        if self._block is None:
            return []
        start_ns, frames = self._block
        ends = []
        for raw in frames:
            ends.append(start_ns + int(frame_bits(raw) * self._bit_ns))
            start_ns = ends[-1] + self._interframe_ns
        return ends

    def _end_block(self) -> None:
        ends = self.block_ends_ns()
        if ends:
            self._free_ns = ends[-1] + self._interframe_ns
        self._block = None

    def longest_ns(self, data_bytes: int) -> int:
        """Time that a standard frame with so much data takes at most, interframe space included."""
        return int(longest_bits(data_bytes) * self._bit_ns) + self._interframe_ns

    def quiet_ns(self) -> int | None:
        """When all that waits will have been carried, at the latest; None when nothing is to be sent."""
        waiting = len(self._waiting)
        if self._on_wire is not None:
            return self._on_wire[0] + waiting * self._longest_ns
        return max(self._free_ns, self.clock_ns) + waiting * self._longest_ns if waiting else None

    def run_until(self, t_ns: int) -> None:
        """Carry all traffic whose transmission ends at or before ``t_ns``, reactions of the listeners included."""
        waiting, bit_ns = self._waiting, self._bit_ns
        if not waiting and self._on_wire is None:
            self.clock_ns = t_ns
            return
        self._end_block()
        while True:
            if self._on_wire is None:
                free, clock = self._free_ns, self.clock_ns
                start = free if free > clock else clock
                # A frame that would start just now waits: others may still join its arbitration.
                if not waiting or start >= t_ns:
                    break
                _, _, raw, sender, identifier = heappop(waiting)
                sender.queued -= 1
                end = start + int(frame_bits(raw) * bit_ns)
                self._free_ns = end + self._interframe_ns
                if end > t_ns:
                    self._on_wire = (end, raw, sender, identifier)
                    break
            else:
                end, raw, sender, identifier = self._on_wire
                if end > t_ns:
                    break
                self._on_wire = None
            self.clock_ns = end
            self._deliver(raw, sender, identifier)
        self.clock_ns = t_ns

    def carry(self, raw: bytes, sender: Controller) -> None:
        """Deliver a frame at the present time, past all tampers."""
        self._reach(raw, sender, self._identifier(raw[:4]))

    def _deliver(self, raw: bytes, sender: Controller, identifier: _Identifier) -> None:
        for tamper in self.tampers:
            if tamper(self, raw, sender):
                return
        self._reach(raw, sender, identifier)

    def _reach(self, raw: bytes, sender: Controller, identifier: _Identifier) -> None:
        now = self.clock_ns
        for ear, hear in self._ears:
            if ear is not sender and not ear.deaf:
                hear(now, raw)
        for listener, handler in identifier.handlers:
            if listener is not sender and not listener.deaf:
                handler(now, raw)
