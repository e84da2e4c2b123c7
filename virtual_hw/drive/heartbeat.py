"""Heartbeats (CiA 301, 7.2.8.3.2): the one this node sends, and those of others it watches."""

from __future__ import annotations

from collections.abc import Callable

from virtual_hw.bus.wire import Bus, Controller
from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.objects import ObjectStore

CONSUMER = 0x1016
PRODUCER = 0x1017
_NEVER = 1 << 63


class _Watch:
    """One consumer entry; it is armed by the first heartbeat it hears."""

    def __init__(self, bus: Bus, controller: Controller, node_id: int, time_ns: int) -> None:
        self.node_id, self.time_ns = node_id, time_ns
        self.deadline_ns = _NEVER
        self._bus, self._controller = bus, controller
        bus.listen(0x700 + node_id, controller, self._heard)

    def close(self) -> None:
        self._bus.ignore(0x700 + self.node_id, self._controller, self._heard)

    def _heard(self, now_ns: int, raw: bytes) -> None:
        if raw[4] == 1:
            self.deadline_ns = now_ns + self.time_ns


class Heartbeats:
    """Producer and consumers; `poll` is called on the firmware's tick."""

    def __init__(
        self,
        store: ObjectStore,
        bus: Bus,
        controller: Controller,
        send: Callable[[], None],
        lost: Callable[[int], None],
    ) -> None:
        """
        Args:
            send: sends this node's heartbeat.
            lost: told the number of a node whose heartbeat stayed away.
        """
        self._store, self._bus, self._controller = store, bus, controller
        self._send, self._lost = send, lost
        self._producer = store.slot(PRODUCER)
        self._subindices = [k for k in range(1, 128) if store.has(CONSUMER, k)]
        self._watches: list[_Watch] = []
        self._due_ns = _NEVER
        self._restart = False
        self.active = False
        """Whether there is anything to poll."""
        store.effects[PRODUCER, 0] = lambda _: self._producer_changed()
        for k in self._subindices:
            store.guards[CONSUMER, k] = lambda value, k=k: self._guard_consumer(k, value)  # type: ignore[misc]
            store.effects[CONSUMER, k] = lambda _: self.configure()

    def configure(self) -> None:
        """Take up what 1016 and 1017 say now; all watches start anew, unarmed."""
        for watch in self._watches:
            watch.close()
        self._watches = []
        for k in self._subindices:
            value = self._store.values[self._store.slot(CONSUMER, k)]
            node_id, time_ms = value >> 16 & 0x7F, value & 0xFFFF
            if node_id and time_ms:
                self._watches.append(_Watch(self._bus, self._controller, node_id, time_ms * 1_000_000))
        self._producer_changed()

    def poll(self, now_ns: int) -> None:
        """Send and judge what is due."""
        if self._restart:
            self._restart = False
            period = self._period_ns()
            self._due_ns = now_ns + period if period else _NEVER
        if now_ns >= self._due_ns:
            self._send()
            self._due_ns += self._period_ns()
            if self._due_ns <= now_ns:
                self._due_ns = now_ns + self._period_ns()
        for watch in self._watches:
            if now_ns > watch.deadline_ns:
                watch.deadline_ns = _NEVER
                self._lost(watch.node_id)

    def _producer_changed(self) -> None:
        self._restart = True
        self.active = self._period_ns() > 0 or bool(self._watches)

    def _period_ns(self) -> int:
        return self._store.values[self._producer] * 1_000_000

    def _guard_consumer(self, subindex: int, value: int) -> None:
        node_id, time_ms = value >> 16 & 0xFF, value & 0xFFFF
        if value >> 24 or node_id > 127:
            raise SdoAbort(Abort.VALUE)
        if not node_id or not time_ms:
            return
        for k in self._subindices:
            other = self._store.values[self._store.slot(CONSUMER, k)]
            if k != subindex and other >> 16 & 0xFF == node_id and other & 0xFFFF:
                raise SdoAbort(Abort.INCOMPATIBLE)
