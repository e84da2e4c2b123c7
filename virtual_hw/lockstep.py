"""The stand-in in lockstep: time stands still until the host ticks (docs/architecture.md, "The local bus")."""

from __future__ import annotations

import select
import sys
from collections.abc import Sequence

from virtual_hw.bus.local import MARK_KIND, SERIAL, TICK, Connection, LocalPort, is_mark, mark
from virtual_hw.rig import Rig
from virtual_hw.usual_cycle import UsualCycle

START_NS = 1_700_000_000_000_000_000
LONGEST_TICK_NS = 60_000_000_000
"""No host means to move time further at once; a wrong clock does."""
STANDSTILL_MS = 1
"""A host that has not ticked for this long lets time stand still."""
TICKS_IN_A_ROW = 64
"""So many ticks are taken before others than the ticking host are looked at."""


class Lockstep:
    """Turns packets of the hosts into traffic and time."""

    def __init__(self, rig: Rig, ports: Sequence[LocalPort]) -> None:
        """
        Args:
            ports: one a bus, in the installation's order; ticks on the first one move time.
        """
        self._rig, self._ports = rig, ports
        self._ticker: Connection | None = None
        self._next_tick = select.poll()
        self._ticked = False
        """Whether the last thing the ticking host did was to tick."""
        self._usual = UsualCycle(rig, ports)

    def follow(self) -> bool:
        """Take tick after tick while they come; whether more may follow at once.

        What the host sends to the other buses is read with the tick on the first; to be woken for each would cost
        more than the rest of the event loop.
        """
        for _ in range(TICKS_IN_A_ROW):
            if not self._ticked or self._ticker is None:
                return False
            self._ticked = False
            if self._next_tick.poll(STANDSTILL_MS):
                end_ns = self._usual.run()
                if end_ns is None:
                    self._usual.forget()
                    self.handle(self._ticker)
                else:
                    self._tell(end_ns, self._rig.power_stage.senses.serial_bytes)
                    self._ticked = True
                    self._answer()
        return True

    def hello_ns(self) -> int:
        return self._rig.now_ns

    def handle(self, connection: Connection) -> None:
        """Act on what a connection has sent; the caller has not read it yet."""
        connection.receive()
        inbox = connection.inbox
        moves_time = connection.bus is self._ports[0].bus
        if not moves_time:
            _forget_past(connection, self._rig.now_ns)
            if connection.alive and inbox and is_mark(inbox[-1]):
                return  # all of it is dated: it waits for the tick on the first bus
        if inbox and (is_mark(inbox[-1]) or any(map(is_mark, inbox))):
            if moves_time:
                self._run(connection)
        else:
            self._configure(connection)
        self._answer()

    def _configure(self, connection: Connection) -> None:
        """Traffic without a tick: SDO and NMT are answered in no time, all else waits for time to move."""
        while connection.inbox:
            raw = connection.inbox.popleft()
            if _is_configuration(int.from_bytes(raw[:4], "little")):
                connection.bus.exchange_at_once(connection.controller, raw)
            else:
                connection.transmit(raw)

    def _run(self, connection: Connection) -> None:
        if self._ticker is None:
            self._ticker = connection
            self._next_tick.register(connection.sock.fileno(), select.POLLIN)
        elif self._ticker is not connection:
            self._send_away(connection, "A second host tried to move time")
            return
        others = [other for port in self._ports[1:] for other in port.connections]
        inbox = connection.inbox
        for other in others:
            # Whatever the host sent there it sent before this; a bus that is ahead of it has nothing new to say.
            while not (other.inbox and other.inbox[-1] == inbox[-1]) and other.receive():
                pass
        while inbox:
            raw = inbox.popleft()
            if not is_mark(raw):
                connection.transmit(raw)
                continue
            t_ns = int.from_bytes(raw[8:], "little")
            if raw[4] != TICK or not 0 <= t_ns - self._rig.now_ns <= LONGEST_TICK_NS:
                self._send_away(connection, f"A host sent a mark of kind {raw[4]} for {t_ns} ns")
                return
            self._advance(t_ns, others)
            self._ticked = True
        for other in others:
            _forget_past(other, self._rig.now_ns)

    def _advance(self, t_ns: int, others: Sequence[Connection]) -> None:
        rig = self._rig
        looks = t_ns == rig.now_ns
        while True:
            due_ns = t_ns
            for other in others:
                if other.inbox:
                    due_ns = min(due_ns, _release(other, rig.now_ns))
            rig.advance(due_ns)
            if due_ns == t_ns:
                break
        # Who asks without moving time has just configured a sensor: no tick has latched what that has carried.
        self._tell(t_ns, rig.power_stage.carried_now() if looks else rig.power_stage.senses.serial_bytes)

    def _tell(self, t_ns: int, serial_bytes: Sequence[int]) -> None:
        """Mark on every bus that time has come to ``t_ns``, and on the first what the serial lines have carried."""
        told = mark(MARK_KIND, t_ns)
        for port in self._ports[1:]:
            for connection in port.connections:
                connection.tell(told)
        for number, total in enumerate(serial_bytes):
            told = mark(SERIAL, number | (total & 0xFFFF_FFFF) << 32) + told
        for connection in self._ports[0].connections:
            connection.tell(told)

    def _answer(self) -> None:
        """Send what is to be told; then the arm moves on while the hosts work."""
        self._flush()
        self._rig.power_stage.run_ahead()

    def _flush(self) -> None:
        # The first bus last: the host waits there first, and finds the others' packets when it wakes.
        for port in reversed(self._ports):
            for connection in port.flush():
                self._drop(connection)

    def _send_away(self, connection: Connection, reason: str) -> None:
        print(f"{reason}; it was disconnected.", file=sys.stderr)
        connection.inbox.clear()
        connection.alive = False

    def _drop(self, connection: Connection) -> None:
        for port in self._ports:
            if connection in port.connections:
                port.drop(connection)
        if self._ticker is connection:
            self._ticker, self._next_tick = None, select.poll()


def _release(connection: Connection, now_ns: int) -> int:
    """Send what is dated now or earlier; returns the date of what follows."""
    inbox = connection.inbox
    while inbox:
        raw = inbox[0]
        if is_mark(raw):
            date_ns = int.from_bytes(raw[8:], "little")
            if date_ns > now_ns:
                return date_ns
            inbox.popleft()
        else:
            connection.transmit(inbox.popleft())
    return 1 << 64


def _forget_past(connection: Connection, now_ns: int) -> None:
    """Drop leading marks of a time that has come: what follows them has no date to wait for."""
    inbox = connection.inbox
    while inbox and is_mark(inbox[0]) and int.from_bytes(inbox[0][8:], "little") <= now_ns:
        inbox.popleft()


def _is_configuration(can_id: int) -> bool:
    return can_id == 0x000 or 0x580 <= can_id <= 0x67F
