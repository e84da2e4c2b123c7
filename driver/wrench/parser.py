"""What every wrench sensor's parser does: find frames in a byte stream, and judge what they say. No input or output."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from enum import IntFlag
from typing import ClassVar

from config.schema import WrenchSensor
from driver.cyclic.cycle import WrenchSample

Wrench = tuple[float, float, float, float, float, float]
"""Fx, Fy, Fz in N; Tx, Ty, Tz in N·m, in the sensor's frame."""


class SampleStatus(IntFlag):
    """`WrenchSample.status`: the low 16 bits are the sensor's own word, the others are what the host found."""

    SKIPPED = 1 << 0
    """The sensor skipped samples before this one; the sample itself is good."""
    OVER_RANGE = 1 << 1
    INVALID = 1 << 2
    RAW_GAUGES = 1 << 3
    """Gauge readings, not newtons."""
    BEYOND_CONFIGURED_RANGE = 1 << 16
    NOT_FINITE = 1 << 17
    TIME_JUMP = 1 << 18
    """The sensor's clock does not go on from the frame before: a restart, or a frame that only looks like one."""
    UNKNOWN_STATUS = 1 << 19
    """The sensor set a status bit that its manual does not name."""
    STANDS_STILL = 1 << 20
    """The same six numbers to the last bit as in the frames before: repeated or frozen; gauges are never so quiet."""


MOST_EQUAL = 4
"""So many frames in a row may carry the same six numbers. Where the noise of a channel is one of its last digits
(gauges are not quieter) a frame repeats the one before by chance once in 2500, and a fifth in a row is to be expected
once in 300 years of an FT 300's 100 Hz."""
GOOD_DESPITE = SampleStatus.SKIPPED
"""Status bits with which a sample still counts."""
_SPOILS = ~int(GOOD_DESPITE)


class WrenchParser(ABC):
    """Bytes of one sensor's line in, judged samples out; the same code live and in replay.

    A frame is accepted when its checksum is right; after any corruption the next intact frame is found as soon as
    it is complete, because every candidate that starts before it also ends before it. A sample that the sensor or
    the host finds fault with comes out with ``fresh`` False and never counts as a measurement.
    """

    header: ClassVar[bytes]
    frame_bytes: ClassVar[int]

    def __init__(self, sensor: WrenchSensor) -> None:
        self.sensor = sensor
        self.samples = 0
        """Good samples so far."""
        self.refused = 0
        """Frames with a right checksum whose content was refused (over range, invalid, time jump)."""
        self.rejected_bytes = 0
        """Bytes that belong to no frame."""
        self.last_good_ns: int | None = None
        """Host time at which the newest good sample arrived."""
        self._pending = b""
        self._newest: Wrench | None = None
        self._equal = 0
        """Frames in a row that carried the newest wrench."""
        self._line_ns = round(self.frame_bytes * 10 / sensor.baud * 1e9)
        self._stale_ns = round(sensor.stale_ms * 1e6)

    def feed(self, data: bytes, now_ns: int) -> list[WrenchSample]:
        """Samples that ``data`` completes, oldest first. ``now_ns``: host time at which the bytes had arrived."""
        if not data:
            return []
        buffer = self._pending + data
        header, size, end = self.header, self.frame_bytes, len(buffer)
        at, frames = 0, list[bytes]()
        while True:
            start = buffer.find(header, at)
            if start < 0:
                kept = max(at, end - len(header) + 1)
                while kept < end and not header.startswith(buffer[kept:]):
                    kept += 1
                self.rejected_bytes += kept - at
                at = kept
                break
            self.rejected_bytes += start - at
            at = start
            if start + size > end:
                break
            frame = buffer[start : start + size]
            if self.intact(frame):
                frames.append(frame)
                at += size
            else:
                self.rejected_bytes += 1
                at += 1
        self._pending = buffer[at:]
        return self._samples(frames, now_ns) if frames else []

    def age_ns(self, now_ns: int) -> int | None:
        """Since the newest good sample arrived; None before the first."""
        return None if self.last_good_ns is None else now_ns - self.last_good_ns

    def stale(self, now_ns: int) -> bool:
        """No good sample within the sensor's ``stale_ms``."""
        age = self.age_ns(now_ns)
        return age is None or age > self._stale_ns

    @property
    def stands_still(self) -> bool:
        """The newest frames repeat one reading: the sensor is frozen, or something sends its frame again and again."""
        return self._equal > MOST_EQUAL

    @abstractmethod
    def intact(self, frame: bytes) -> bool:
        """Is the frame's checksum right?"""

    @abstractmethod
    def _samples(self, frames: list[bytes], now_ns: int) -> list[WrenchSample]:
        """Decode intact frames that came with one `feed`."""

    def _judged(self, wrench: Wrench, status: int, stamp_ns: int, now_ns: int) -> WrenchSample:
        """The sample, with the host's findings added to its status."""
        force, torque = self.sensor.range_n, self.sensor.range_nm
        if not all(map(math.isfinite, wrench)):
            status |= SampleStatus.NOT_FINITE
        elif max(map(abs, wrench[:3])) > force or max(map(abs, wrench[3:])) > torque:
            status |= SampleStatus.BEYOND_CONFIGURED_RANGE
        self._equal = self._equal + 1 if wrench == self._newest else 1
        self._newest = wrench
        if self.stands_still:
            status |= SampleStatus.STANDS_STILL
        fresh = not status & _SPOILS
        if fresh:
            self.samples += 1
            self.last_good_ns = now_ns
        else:
            self.refused += 1
        return WrenchSample(wrench, status, stamp_ns, fresh)
