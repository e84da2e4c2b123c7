"""What both sensors have in common: samples become frames, frames become bytes on the line, commands are heard."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from config.schema import WrenchSensor
from virtual_hw.wrench.line import PtyLine
from virtual_hw.wrench.transducer import Transducer

BACKLOG = 2
"""Frames the sensor holds for its line; more are skipped."""


class Sensor(ABC):
    """A wrist sensor on its serial line; times are of the arm's clock, ns."""

    def __init__(self, sensor: WrenchSensor, transducer: Transducer, line: PtyLine) -> None:
        self.sensor = sensor
        self._transducer, self.line = transducer, line
        self._streaming = False
        self._skipped = False
        self.tamper: Callable[[bytes], bytes] | None = None
        """A fault of the electronics: changes each frame before it goes to the line; no bytes for none."""
        self.latest = [0.0] * 6
        """Last output sample, N and N·m in the sensor's frame."""
        self.total_bytes = 0
        """Bytes the line has carried to the host altogether."""

    def fileno(self) -> int:
        """Readable when the host has sent commands."""
        return self.line.fileno()

    def close(self) -> None:
        self.line.close()

    def advance(self, now_ns: int) -> None:
        """Hear commands, take the samples and send the bytes that are due by ``now_ns``."""
        received = self.line.receive()
        if received:
            self._hear(received, now_ns)
        for instant_ns, wrench in self._transducer.samples(now_ns):
            self.latest = wrench
            if not self._streaming:
                continue
            if self.line.backlog >= BACKLOG:
                self._skipped = True
                continue
            frame = self._frame(wrench, instant_ns, self._skipped)
            if self.tamper is not None:
                frame = self.tamper(frame)
            if frame:
                self.line.queue(frame, instant_ns)
            self._skipped = False
        self.line.pump(now_ns)
        self.total_bytes = self.line.total_bytes

    @abstractmethod
    def _hear(self, received: bytes, now_ns: int) -> None:
        """Act on what the host has written."""

    @abstractmethod
    def _frame(self, wrench: list[float], instant_ns: int, skipped: bool) -> bytes:
        """One frame of the stream; ``skipped``: samples before this one were not sent."""
