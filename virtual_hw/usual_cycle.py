"""The lockstep cycle as it nearly always is, without simulating its frames one by one.

In most cycles each bus carries nothing but the host's RPDOs (and its heartbeat), the SYNC, and then the TPDOs that the
drives send at each, in the order of their identifiers. What that does is known without an event queue: all RPDOs wait
for the SYNC, all TPDOs are ready when it ends, and the worst case of stuffing says that either is through in time.
Anything else (a fault script, SDO traffic, a drive that is not operational, a TPDO that is sent seldom, a frame of
another length, a second listener) is left to the buses' own simulation, which tells the same bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter

from virtual_hw.bus.frames import FRAME_SIZE, arbitration_key, frame
from virtual_hw.bus.local import MARK_KIND, TICK, Connection, LocalPort, mark
from virtual_hw.bus.wire import Bus, FrameHandler
from virtual_hw.drive.node import DriveNode
from virtual_hw.drive.pdo import TransmitPdo
from virtual_hw.rig import Rig

SYNC = frame(0x080)
_TAIL = struct.Struct("<8xQ16s8xQ")
_TAIL_FRAMES = 3
"""TICK, SYNC, TICK."""
_HEAD = 5
"""Identifier and length of a frame."""
_TICK_HEAD = mark(TICK, 0)[:_HEAD]
_LONGEST_NS = 1_000_000_000
"""A longer cycle is not usual."""
_HEARTBEATS = range(0x700, 0x780)


@dataclass(frozen=True)
class _Commands:
    """A bus's commands of one cycle, for packets of one shape."""

    places: tuple[slice, ...]
    """Where each frame is in the packet, in the order in which the bus carries them."""
    receivers: tuple[tuple[int, FrameHandler], ...]
    """Number of a frame, and who takes it, whenever it comes."""
    timed: tuple[tuple[int, FrameHandler], ...]
    """The same of frames whose receivers look at the time: heartbeats, RPDOs with a deadline."""
    longest_ns: int
    """Time that all of them take at most."""


class _UsualBus:
    """What the usual cycle does on one bus."""

    def __init__(self, bus: Bus, connection: Connection, nodes: Sequence[DriveNode]) -> None:
        self.bus, self.connection, self.nodes = bus, connection, nodes
        tpdos = [(arbitration_key(pdo.can_id.to_bytes(4, "little")), pdo) for n in nodes for pdo in n.sync_tpdos]
        self.seldom = tuple(pdo for _, pdo in tpdos if not pdo.every_sync)
        """Sent at each so-many-th SYNC; a cycle with one of them is not usual."""
        tpdos = [(key, pdo) for key, pdo in tpdos if pdo.every_sync]
        tpdos.sort(key=lambda entry: entry[0])
        self.tpdos: tuple[TransmitPdo, ...] = tuple(pdo for _, pdo in tpdos)
        self.last_key = max([arbitration_key(SYNC[:4]), *(key for key, _ in tpdos)])
        self.longest_ns = bus.longest_ns(0) + sum(bus.longest_ns(pdo.size) for pdo in self.tpdos)
        """From the SYNC to the end of the last TPDO, at most."""
        accepted = {(pdo.can_id, pdo.size): pdo.timeout_ns > 0 for node in nodes for pdo in node.sync_rpdos}
        accepted |= {(can_id, 1): True for can_id in _HEARTBEATS}
        self._timed = {can_id.to_bytes(4, "little") + bytes((n,)): timed for (can_id, n), timed in accepted.items()}
        """Frames that the host may send in a usual cycle, by their heads, and whether it matters when they come."""
        self._shapes: dict[tuple[bytes, ...], _Commands | None] = {}
        listening = [entry for node in nodes for entry in [(node.controller, node.on_sync)]]
        told_to_others = any(bus.listeners(pdo.can_id.to_bytes(4, "little")) for pdo in self.tpdos)
        self.possible = (
            bus.ears == [connection.controller]
            and bus.listeners(SYNC[:4]) == listening
            and not told_to_others
            and all(a < b for (a, _), (b, _) in pairwise(tpdos))
            and all(node.regular for node in nodes)
        )

    def commands(self, packet: bytes) -> _Commands | None:
        """What a packet brings before its SYNC; None when anything in it is unusual."""
        heads = _heads(packet)
        try:
            return self._shapes[heads]
        except KeyError:
            shape = self._shapes[heads] = self._commands(heads)
            return shape

    def _commands(self, heads: tuple[bytes, ...]) -> _Commands | None:
        *before, tick, sync, last = heads
        if (tick, sync, last) != (_TICK_HEAD, SYNC[:_HEAD], _TICK_HEAD) or not self._timed.keys() >= set(before):
            return None
        carried = sorted(range(len(before)), key=lambda k: arbitration_key(before[k][:4]))
        receivers: dict[bool, list[tuple[int, FrameHandler]]] = {True: [], False: []}
        for number, k in enumerate(carried):
            head = before[k]
            receivers[self._timed[head]] += [(number, handler) for _, handler in self.bus.listeners(head[:4])]
        return _Commands(
            tuple(slice(FRAME_SIZE * k, FRAME_SIZE * (k + 1)) for k in carried),
            tuple(receivers[False]),
            tuple(receivers[True]),
            sum(self.bus.longest_ns(head[4]) for head in before),
        )


class UsualCycle:
    """Runs usual cycles of one ticking host; leaves all others alone."""

    def __init__(self, rig: Rig, ports: Sequence[LocalPort]) -> None:
        self._rig, self._ports = rig, ports
        self._buses: list[_UsualBus] = []
        self._changes = -1

    def forget(self) -> None:
        """Something unusual has happened: look at everything anew before the next cycle."""
        self._changes = -1

    def run(self) -> int | None:
        """Read the packets of all buses and run their cycle; the time at which it ends.

        None when it is not the usual one: then the packets are in the connections' inboxes, and nothing has happened.
        That the end has come is left to be told.
        """
        if sum(port.bus.changes for port in self._ports) != self._changes and not self._look():
            return None
        packets = [usual.connection.read() for usual in self._buses]
        end_ns = self._run(packets)
        if end_ns is None:
            for usual, packet in zip(self._buses, packets, strict=True):
                usual.connection.take(packet)
        return end_ns

    def _look(self) -> bool:
        """Whether the drives and their host are such that a cycle can be usual."""
        rig = self._rig
        if rig.at_ticks or not all(len(port.connections) == 1 for port in self._ports):
            return False
        self._buses = [
            _UsualBus(port.bus, port.connections[0], [node for node in rig.nodes if node.bus is port.bus])
            for port in self._ports
        ]
        if not all(usual.possible for usual in self._buses):
            return False
        self._changes = sum(port.bus.changes for port in self._ports)
        return True

    def _run(self, packets: Sequence[bytes]) -> int | None:
        rig, buses = self._rig, self._buses
        tail = packets[0][-_TAIL_FRAMES * FRAME_SIZE :]
        if len(tail) < _TAIL.size:
            return None
        start_ns: int
        end_ns: int
        start_ns, _, end_ns = _TAIL.unpack(tail)
        lead_ns = start_ns - rig.now_ns
        if end_ns - rig.now_ns > _LONGEST_NS:
            return None
        plans = self._plans(packets, tail, lead_ns, end_ns - start_ns)
        if plans is None:
            return None
        self._command(plans, start_ns)
        rig.advance(start_ns)
        begun = mark(MARK_KIND, start_ns)
        for usual in buses:
            usual.connection.tell(begun)
            if usual.bus.is_free_for(usual.last_key):
                told = [pdo.frame() for pdo in usual.tpdos]
                usual.bus.carry_block([SYNC, *told])
                usual.connection.hear_block(told)
                for pdo in usual.seldom:
                    pdo.pass_sync()
                for node in usual.nodes:
                    node.act()
            else:
                usual.connection.transmit(SYNC)
                self.forget()
        rig.advance(end_ns)
        return end_ns

    def _plans(
        self, packets: Sequence[bytes], tail: bytes, lead_ns: int, window_ns: int
    ) -> list[tuple[_UsualBus, _Commands, bytes]] | None:
        """What each bus's packet commands; None when one is unusual or could be late."""
        plans = []
        for usual, packet in zip(self._buses, packets, strict=True):
            commands = usual.commands(packet) if packet.endswith(tail) else None
            if (
                commands is None
                or commands.longest_ns > lead_ns
                or usual.longest_ns > window_ns
                or any(pdo.due for pdo in usual.seldom)
                or usual.connection.inbox
                or not usual.bus.is_free_for(1 << 64)
            ):
                return None
            plans.append((usual, commands, packet))
        return plans

    def _command(self, plans: Sequence[tuple[_UsualBus, _Commands, bytes]], start_ns: int) -> None:
        """Have the drives receive the commands."""
        rig = self._rig
        tick_between = rig.next_tick_ns < start_ns
        timed: list[tuple[int, FrameHandler, bytes]] = []
        for usual, commands, packet in plans:
            frames = [packet[place] for place in commands.places]
            usual.bus.carry_block(frames)
            for k, receive in commands.receivers:
                receive(start_ns, frames[k])
            if commands.timed:
                # Deadlines are looked at on servo ticks: with none among the frames, all of their time is one.
                ends_ns = usual.bus.block_ends_ns() if tick_between else [start_ns - 1] * len(frames)
                timed += [(ends_ns[k], receive, frames[k]) for k, receive in commands.timed]
        if tick_between:
            timed.sort(key=itemgetter(0))
        for at_ns, receive, raw in timed:
            if rig.next_tick_ns <= at_ns:
                rig.advance(at_ns)
            receive(at_ns, raw)


def _heads(packet: bytes) -> tuple[bytes, ...]:
    """Identifier and length of each frame."""
    layout = _LAYOUTS.get(len(packet))
    if layout is None:
        layout = _LAYOUTS[len(packet)] = struct.Struct(f"{_HEAD}s{FRAME_SIZE - _HEAD}x" * (len(packet) // FRAME_SIZE))
    return layout.unpack(packet)


_LAYOUTS: dict[int, struct.Struct] = {}
"""By a packet's length, which the local bus bounds."""
