"""A serial line on a pseudo-terminal: bytes leave at the baud rate, or in the bursts of a USB bridge."""

from __future__ import annotations

import errno
import os
import pty
import select
import tty
from collections import deque
from pathlib import Path

from config import InputError

BITS_A_BYTE = 10
"""8N1: start bit, eight data bits, stop bit."""
READ_BYTES = 1024


class PtyLine:
    """The device's end of a serial line whose other end is the link ``path``.

    Without a host on the line, bytes go nowhere, as on a cable; a host that does not read loses what overflows.
    Times are of the arm's clock, ns.
    """

    def __init__(self, path: Path, baud: int, latency_ns: int) -> None:
        """``latency_ns``: distance of the bursts of a USB bridge; 0 for a bare UART.

        Raises InputError when the link cannot be made.
        """
        self.path, self.baud, self.latency_ns = path, baud, latency_ns
        self.total_bytes = 0
        """Bytes that the line has carried to a host altogether."""
        self._queue: deque[tuple[int, bytes]] = deque()
        self._sent = 0
        self._free_ns = 0
        self._last_burst_ns = 0
        # A hung-up line is "ready" all the time; edge-triggered inside an epoll of its own it wakes nobody for nothing.
        self._ready = select.epoll()
        self._plugged = False
        self.plug_in()

    def plug_in(self) -> None:
        """Make the device and its link. Raises InputError when the link cannot be made."""
        self._master, slave = pty.openpty()
        self._device = os.ttyname(slave)
        tty.setraw(slave)
        # From here on the kernel reports "hung up" whenever no host has the line open.
        os.close(slave)
        os.set_blocking(self._master, False)
        self._hang_up = select.poll()
        self._hang_up.register(self._master, 0)
        self._ready.register(self._master, select.EPOLLIN | select.EPOLLET)
        self._plugged = True
        try:
            self._link()
        except (InputError, OSError):
            self.close()
            raise

    def unplug(self) -> None:
        """Take the device away, as when the cable is pulled; `plug_in` makes another."""
        if self.path.is_symlink() and str(self.path.readlink()) == self._device:
            self.path.unlink()
        self._plugged = False
        self._queue.clear()
        self._sent = 0
        os.close(self._master)

    def _link(self) -> None:
        if os.path.lexists(self.path):
            if not self.path.is_symlink():
                raise InputError(str(self.path), "is in the way of the stand-in's serial line", "remove it")
            self.path.unlink()
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.symlink_to(self._device)
        except OSError as error:
            raise InputError(
                str(self.path), f"the link to the serial line cannot be made ({error.strerror})", "check the directory"
            ) from None

    def fileno(self) -> int:
        """Readable when the host has written, opened or closed."""
        return self._ready.fileno()

    def receive(self) -> bytes:
        """All that the host has written."""
        if not self._plugged or not self._ready.poll(0):
            return b""
        parts = []
        while True:
            try:
                data = os.read(self._master, READ_BYTES)
            except BlockingIOError:
                break
            except OSError as error:
                if error.errno == errno.EIO:  # no host on the line
                    break
                raise
            if not data:
                break
            parts.append(data)
        return b"".join(parts)

    @property
    def backlog(self) -> int:
        """Messages that wait for the line or are on it."""
        return len(self._queue)

    def queue(self, data: bytes, ready_ns: int) -> None:
        """Send ``data`` from ``ready_ns`` on, after what is queued already."""
        start = max(ready_ns, self._free_ns)
        self._free_ns = start + self._duration(len(data))
        self._queue.append((start, data))

    def _duration(self, size: int) -> int:
        return size * BITS_A_BYTE * 1_000_000_000 // self.baud

    def pump(self, now_ns: int) -> None:
        """Let everything arrive at the host that is due by ``now_ns``."""
        if not self._queue:
            return
        if self.latency_ns:
            now_ns -= now_ns % self.latency_ns
            if now_ns == self._last_burst_ns:
                return
            self._last_burst_ns = now_ns
        parts = []
        while self._queue:
            start, data = self._queue[0]
            due = min(len(data), (now_ns - start) * self.baud // (BITS_A_BYTE * 1_000_000_000))
            if due > self._sent:
                parts.append(data[self._sent : due])
                self._sent = due
            if due < len(data):
                break
            self._queue.popleft()
            self._sent = 0
        if parts:
            self._write(b"".join(parts))

    def answer(self, data: bytes, now_ns: int) -> None:
        """Reply to the host at once: what was being sent is finished first, what was waiting is dropped.

        Not paced, since in lockstep the host configures the sensor while time stands still.
        """
        if self._queue and self._sent:
            self._write(self._queue[0][1][self._sent :])
        self._queue.clear()
        self._sent, self._free_ns = 0, now_ns
        self._write(data)

    def _write(self, data: bytes) -> None:
        if not self._plugged or self._hang_up.poll(0):
            return
        try:
            self.total_bytes += os.write(self._master, data)
        except BlockingIOError:
            return  # the host does not read: its receive buffer has overflowed

    def close(self) -> None:
        """Take the line away for good."""
        if self._plugged:
            self.unplug()
        self._ready.close()
