"""Faults of single frames: lost, doubled, delayed, out of order, of a wrong length."""

from __future__ import annotations

from abc import abstractmethod
from typing import Literal

from pydantic import PrivateAttr

from virtual_hw.bus.frames import CAN_FRAME
from virtual_hw.bus.wire import Bus, Controller
from virtual_hw.faults.fault import JointFault, Stage

FrameName = Literal[
    "feedback", "command", "sync", "heartbeat", "host_heartbeat", "emergency", "sdo_answer", "sdo_request"
]
_BASES = {
    "feedback": (0x180, 0x280, 0x380, 0x480),
    "command": (0x200, 0x300, 0x400, 0x500),
    "heartbeat": (0x700,),
    "emergency": (0x080,),
    "sdo_answer": (0x580,),
    "sdo_request": (0x600,),
}


class FrameFault(JointFault):
    """Acts on frames to or from one joint's drive; ``sync`` means those of its bus, ``host_heartbeat`` the one that the
    drive watches (1016:01). ``only_first`` stops after one."""

    frame: FrameName
    only_first: bool = False
    _identifiers: frozenset[bytes] = PrivateAttr(default=frozenset())
    _done: bool = PrivateAttr(default=False)

    def begin(self, stage: Stage) -> None:
        node = stage.node(self.joint)
        if self.frame == "sync":
            ids = [0x080]
        elif self.frame == "host_heartbeat":
            watched = node.store.values[node.store.slot(0x1016, 1)]
            ids = [0x700 + (watched >> 16 & 0x7F)]
        else:
            ids = [base + node.node_id for base in _BASES[self.frame]]
        self._identifiers = frozenset(can_id.to_bytes(4, "little") for can_id in ids)
        node.bus.tampers.append(self._tamper)

    def end(self, stage: Stage) -> None:
        stage.node(self.joint).bus.tampers.remove(self._tamper)

    def _tamper(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        if raw[:4] not in self._identifiers or self._done:
            return False
        self._done = self.only_first
        return self._act(bus, raw, sender)

    @abstractmethod
    def _act(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        """Whether the frame has been dealt with; it is delivered as it is otherwise."""


class FrameLost(FrameFault):
    kind: Literal["frame_lost"]

    def _act(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        return True


class FrameDoubled(FrameFault):
    kind: Literal["frame_doubled"]

    def _act(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        bus.carry(raw, sender)
        return False


class FrameDelayed(FrameFault):
    """Held back for ``by_ms``: a gateway that buffers."""

    kind: Literal["frame_delayed"]
    by_ms: float
    _held: list[tuple[int, bytes, Controller]] = PrivateAttr(default_factory=list)

    def _act(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        self._held.append((bus.clock_ns + round(self.by_ms * 1e6), raw, sender))
        return True

    def tick(self, stage: Stage, now_ns: int) -> None:
        bus = stage.node(self.joint).bus
        while self._held and self._held[0][0] <= now_ns:
            _, raw, sender = self._held.pop(0)
            bus.carry(raw, sender)


class FramesSwapped(FrameFault):
    """Every frame arrives after the one that follows it."""

    kind: Literal["frames_swapped"]
    _held: tuple[bytes, Controller] | None = PrivateAttr(default=None)

    def _act(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        if self._held is None:
            self._held = raw, sender
            return True
        bus.carry(raw, sender)
        bus.carry(*self._held)
        self._held = None
        return True


class FrameLength(FrameFault):
    """``length`` data bytes, whatever was sent."""

    kind: Literal["frame_length"]
    length: int

    def _act(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        bus.carry(CAN_FRAME.pack(int.from_bytes(raw[:4], "little"), self.length, raw[8:]), sender)
        return True
