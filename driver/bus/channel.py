"""A CAN channel: ``socketcan:<interface>`` or ``local:<path>``. Nothing above it knows whether it is real."""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path

from config.errors import InputError
from driver.bus.errors import ChannelFault

RECEIVE_BYTES = 1 << 16
"""Size of a receive buffer that holds whatever a bus carries between two cycles (4096 frames)."""


class Channel(ABC):
    """One controller on one bus. Frames go in and out as concatenated 16-byte ``struct can_frame``.

    Not safe for use by several threads at once. Failures in use raise `driver.bus.errors.ChannelFault`.
    """

    spec: str
    """As configured, for example ``socketcan:can0``."""
    hello_ns: int | None = None
    """Virtual time at which the bus stood when we connected, in lockstep; None on a bus in wall-clock time."""
    rx_overflow: int = 0
    """Frames that the kernel dropped because nobody drained, since opening (SocketCAN; noticed one drain later)."""

    @property
    def lockstep(self) -> bool:
        """Whether time on this bus moves by our TICKs."""
        return self.hello_ns is not None

    @abstractmethod
    def send(self, data: bytes | bytearray | memoryview) -> None:
        """Send k frames (k·16 bytes) in order; never waits in wall-clock time.

        Raises TransmitQueueFull when the bus does not take them, ChannelClosed when it is gone.
        """

    @abstractmethod
    def drain(self, buffer: bytearray, filled: int = 0) -> int:
        """Take all frames that have arrived, without waiting, behind the ``filled`` bytes already there.

        Returns the bytes filled in all, a multiple of 16. Error frames are among them (identifier flag
        0x20000000), marks are not. Raises ChannelClosed when the bus is gone.
        """

    @abstractmethod
    def fileno(self) -> int:
        """For poll and select: readable when frames wait."""

    @abstractmethod
    def close(self) -> None:
        """Leave the bus; closing twice is allowed."""

    def tick(self, t_ns: int) -> None:
        """Lockstep: everything for the time before ``t_ns`` has been sent; let virtual time advance to it."""
        raise ChannelFault(f"{self.spec} runs in wall-clock time, nothing moves it by ticks")

    def wait_mark(self, t_ns: int, buffer: bytearray, filled: int = 0) -> int:
        """Lockstep: wait until all frames that ended before ``t_ns`` are here; returns like `drain`."""
        raise ChannelFault(f"{self.spec} runs in wall-clock time, it carries no marks")

    @property
    def earlier(self) -> int:
        """Lockstep: bytes in the buffer of the last `wait_mark` that came before its first mark."""
        return 0

    @property
    def serial_bytes(self) -> dict[int, int]:
        """Lockstep: how many bytes each sensor's line had carried altogether at the last mark, by sensor number."""
        return {}

    def __enter__(self) -> Channel:
        return self

    def __exit__(self, *exc: object) -> None:
        self.close()


def open_channel(spec: str, *, run_dir: Path | None = None) -> Channel:
    """Open ``socketcan:<interface>`` or ``local:<path>`` (relative to ``run_dir``, else the run directory).

    Raises InputError, naming the remedy, for an unknown kind of channel, a bus that is not there or is down,
    a missing permission, or a kernel without SocketCAN.
    """
    # Here, because both kinds are Channels and import this file.
    from driver.bus.local import LocalChannel
    from driver.bus.socketcan import SocketCanChannel

    kind, _, name = spec.partition(":")
    if kind == "socketcan" and name:
        return SocketCanChannel(name)
    if kind == "local" and name:
        return LocalChannel(name, run_dir=run_dir)
    raise InputError(f"channel {spec!r}", "is not a CAN channel", "write socketcan:<interface> or local:<path>")
