"""The nodes of one bus as `canopen` sees them: NMT, boot-up and heartbeats, SDO, and strangers that send too."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from enum import IntEnum
from pathlib import Path
from threading import Condition

import can
import canopen

from config.eds_check import read_eds
from config.errors import InputError
from config.schema import Bus, Drive, Installation, Joint
from driver.bus.python_can import LocalBus, python_can_bus
from driver.cia402.sdo import SdoObjects

SYNC_ID, HEARTBEAT_ID, SDO_REQUEST_ID = 0x080, 0x700, 0x600
_POLL_S = 0.02
LAST_NODE = 127


class Nmt(IntEnum):
    """NMT commands (CiA 301)."""

    START = 0x01
    STOP = 0x02
    PRE_OPERATIONAL = 0x80
    RESET_NODE = 0x81
    RESET_COMMUNICATION = 0x82


class NmtState(IntEnum):
    """States that a heartbeat tells; BOOT_UP is sent once."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class BusNodes:
    """One bus, opened for configuration. Raises InputError as `open_channel` does."""

    def __init__(self, bus: Bus, *, run_dir: Path | None = None) -> None:
        self.bus = bus
        python_can = python_can_bus(bus.channel, run_dir=run_dir)
        self.lockstep = isinstance(python_can, LocalBus) and python_can.lockstep
        """Whether time stands still here while we configure: then nothing comes unasked."""
        self._network = canopen.Network(python_can)
        self._network.NOTIFIER_CYCLE = _POLL_S
        self._heard: dict[int, list[int]] = defaultdict(list)
        self._strangers: set[int] = set()
        self._news = Condition()
        self._network.connect()

    def add(self, joint: Joint, drive: Drive) -> SdoObjects:
        """Take up one drive: its SDO channel, and its heartbeats from now on."""
        node = self._network.add_node(joint.node_id, read_eds(drive.eds))
        self._network.subscribe(HEARTBEAT_ID + joint.node_id, self._on_heartbeat)
        return SdoObjects(node, joint)

    def command(self, command: Nmt, node_id: int) -> None:
        """Send an NMT command to one node (0: to all); what was heard of it before is forgotten."""
        with self._news:
            self._heard[node_id].clear()
        try:
            self._network.send_message(0x000, bytes((command, node_id)))
        except can.CanError as fault:
            raise InputError(self.bus.channel, f"the bus failed ({fault})", "check the bus") from None

    def wait_for(self, node_id: int, states: Collection[int], timeout_s: float) -> bool:
        """Whether a heartbeat with one of these states has come since the last command, or comes within the time."""
        with self._news:
            return self._news.wait_for(lambda: any(s in states for s in self._heard[node_id]), timeout_s)

    def strangers(self, identifiers: Iterable[int], seconds: float) -> tuple[int, ...]:
        """Listen for a while: which of these identifiers does somebody else send?"""
        wanted = tuple(identifiers)
        self._strangers.clear()
        for identifier in wanted:
            self._network.subscribe(identifier, self._on_stranger)
        time.sleep(seconds)
        for identifier in wanted:
            self._network.unsubscribe(identifier, self._on_stranger)
        return tuple(sorted(self._strangers))

    def close(self) -> None:
        self._network.disconnect()

    def _on_heartbeat(self, can_id: int, data: bytes, _: float) -> None:
        if len(data) == 1:
            with self._news:
                self._heard[can_id - HEARTBEAT_ID].append(data[0] & 0x7F)
                self._news.notify_all()

    def _on_stranger(self, can_id: int, _data: bytes, _: float) -> None:
        self._strangers.add(can_id)


@contextmanager
def open_nodes(installation: Installation, run_dir: Path | None = None) -> Iterator[list[BusNodes]]:
    """All buses of an installation, in its order, opened for configuration and closed at the end."""
    with ExitStack() as stack:
        opened = []
        for bus in installation.bus:
            nodes = BusNodes(bus, run_dir=run_dir)
            stack.callback(nodes.close)
            opened.append(nodes)
        yield opened


def master_node_id(installation: Installation) -> int:
    """Node id of the host, whose heartbeat the drives supervise: the highest that no drive has on any bus.

    Raises InputError when drives take all ids.
    """
    taken = {joint.node_id for joint in installation.joint}
    free = next((node for node in range(LAST_NODE, 0, -1) if node not in taken), None)
    if free is None:
        raise InputError("joint.node_id", "no node id is left for the host", "free one of 1 to 127")
    return free
