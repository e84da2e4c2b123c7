"""The stand-in in wall-clock time: the arm follows real time whether anybody speaks to it or not."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from virtual_hw.bus.local import Connection, LocalPort, is_mark
from virtual_hw.bus.socketcan import SocketCanPort
from virtual_hw.rig import Rig

_STALL_NS = 250_000_000
"""A longer standstill of this process is taken out of the arm's time, not caught up."""


class WallClock:
    """Turns real time and frames of the hosts into traffic."""

    def __init__(self, rig: Rig, ports: Sequence[LocalPort | SocketCanPort]) -> None:
        self._rig, self._ports = rig, ports
        self._lag_ns = time.monotonic_ns() - rig.now_ns

    def hello_ns(self) -> int:
        return 0

    def handle(self, connection: Connection) -> None:
        """Put on the bus what a connection has sent; the caller has not read it yet."""
        connection.receive()
        self.advance()
        while connection.inbox:
            raw = connection.inbox.popleft()
            if not is_mark(raw):
                connection.transmit(raw)

    def advance(self) -> None:
        """Bring the rig to the present and tell the hosts what has happened."""
        now_ns = time.monotonic_ns() - self._lag_ns
        behind_ns = now_ns - self._rig.now_ns
        if behind_ns > _STALL_NS:
            print(f"The stand-in arm was stalled for {behind_ns * 1e-6:.0f} ms; its time stood still.", file=sys.stderr)
            self._lag_ns += behind_ns
            now_ns -= behind_ns
        self._rig.advance(now_ns)
        for port in self._ports:
            if isinstance(port, SocketCanPort):
                port.flush()
                continue
            for connection in port.flush():
                port.drop(connection)

    def seconds_to_next_event(self) -> float:
        due_ns = self._rig.next_event_ns() + self._lag_ns
        return max(0.0, (due_ns - time.monotonic_ns()) * 1e-9)
