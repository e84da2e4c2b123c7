"""The wrench sensors' serial lines in the loop: read each cycle without waiting, in lockstep to the announced byte."""

from __future__ import annotations

import select
from collections.abc import Callable, Mapping
from contextlib import ExitStack

from config import Installation
from driver.cyclic.cycle import WrenchSample
from driver.cyclic.slot import Serial
from driver.cyclic.status import SensorStatus
from driver.wrench import SensorLost, WrenchParser, WrenchPort, make_parser

LOCKSTEP_TIMEOUT_S = 5.0
QUIET_S = 0.1
"""The tail of a configuration's last answer is through the kernel's line by then."""


class _Line:
    def __init__(self, port: WrenchPort, parser: WrenchParser) -> None:
        self.port, self.parser = port, parser
        self.baseline: int | None = None
        """Lockstep: bytes that the line had carried before this port was opened; None before that was asked."""
        self.lost = False
        self.was_stale = True


class WrenchLines:
    """All sensors of an installation. Opening configures them and starts their streams; raises InputError."""

    def __init__(self, installation: Installation) -> None:
        self._lines: list[_Line] = []
        with ExitStack() as opened:
            for sensor in installation.wrench_sensor:
                port = opened.enter_context(WrenchPort.open(sensor))
                port.configure()
                self._lines.append(_Line(port, make_parser(sensor)))
            opened.pop_all()
        self.events: list[str] = []
        self.now_ns = 0

    def __bool__(self) -> bool:
        return bool(self._lines)

    def anchor(self, look: Callable[[], Mapping[int, int]]) -> None:
        """Lockstep, time standing still: on lines just opened what came so far is read away and counting starts.

        ``look`` tells how many bytes each line has carried altogether.
        """
        for number, line in enumerate(self._lines):
            if line.lost or line.baseline is not None:
                continue
            try:
                line.baseline = _carried_before(line.port, number, look)
            except SensorLost as lost:
                self._lose(line, lost)

    def reopen_lost(self) -> None:
        """Take up sensors again that were unplugged, between motions. Raises InputError when one is still absent."""
        for line in self._lines:
            if line.lost:
                line.port.close()
                port = WrenchPort.open(line.port.sensor)
                port.configure()
                line.port, line.parser, line.lost, line.baseline = port, make_parser(port.sensor), False, None
                self.events.append(f"wrench sensor {port.sensor.name}: back")

    def read(self, now_ns: int, totals: dict[int, int] | None = None) -> tuple[list[Serial], WrenchSample | None]:
        """Bytes since the last cycle, and the newest sample of the first sensor; ``totals`` in lockstep.

        The sample has ``fresh`` False when nothing valid came in this cycle; None before there is any.
        """
        self.now_ns = now_ns
        serial: list[Serial] = []
        newest: WrenchSample | None = None
        for number, line in enumerate(self._lines):
            data = self._bytes(line, None if totals is None else totals.get(number))
            if data:
                serial.append((number, data))
                samples = line.parser.feed(data, now_ns)
                if samples and number == 0:
                    good = [s for s in samples if s.fresh]
                    newest = (good or samples)[-1]
            stale = line.parser.stale(now_ns)
            if stale is not line.was_stale:
                line.was_stale = stale
                self.events.append(f"wrench sensor {line.port.sensor.name}: {_condition(line.parser, stale=stale)}")
        return serial, newest

    def take_events(self) -> list[str]:
        events, self.events = self.events, []
        return events

    def status(self) -> tuple[SensorStatus, ...]:
        found = []
        for line in self._lines:
            parser, age = line.parser, line.parser.age_ns(self.now_ns)
            rejected = parser.rejected_bytes + parser.refused
            stale = line.lost or parser.stale(self.now_ns)
            found.append(
                SensorStatus(
                    line.port.sensor.name,
                    parser.samples,
                    rejected,
                    None if age is None else age / 1e6,
                    stale,
                    "its line is gone" if line.lost else _condition(parser, stale=stale),
                )
            )
        return tuple(found)

    def close(self) -> None:
        for line in self._lines:
            line.port.close()

    def _bytes(self, line: _Line, total: int | None) -> bytes:
        if line.lost:
            return b""
        try:
            if total is None:
                return line.port.read()
            return line.port.read_up_to(total - (line.baseline or 0), LOCKSTEP_TIMEOUT_S)
        except SensorLost as lost:
            self._lose(line, lost)
            return b""

    def _lose(self, line: _Line, why: SensorLost) -> None:
        line.lost = True
        self.events.append(str(why))


def _carried_before(port: WrenchPort, number: int, look: Callable[[], Mapping[int, int]]) -> int:
    """Bytes that the line of sensor ``number`` has carried beyond those that ``port`` has received.

    Asked until nothing has come meanwhile: what was on its way when the line was counted would be counted twice.
    """
    while True:
        received, total = port.received, look().get(number, 0)
        while select.select([port], [], [], QUIET_S)[0] and port.read():
            pass
        if port.received == received:
            return total - received


def _condition(parser: WrenchParser, *, stale: bool) -> str:
    if not stale:
        return "valid"
    why = "; its reading stands still: it is frozen, or its frames are sent again" if parser.stands_still else ""
    return f"no valid sample for too long{why}"
