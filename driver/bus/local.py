"""The local bus: CAN frames and marks over an AF_UNIX packet socket, in wall-clock time or in lockstep."""

from __future__ import annotations

import errno
import socket
import struct
import time
from pathlib import Path

from config.errors import InputError
from config.paths import run_directory
from driver.bus.channel import Channel
from driver.bus.errors import ChannelClosed, ChannelFault, MarkTimeout, TransmitQueueFull
from driver.bus.frames import FRAME_BYTES, MARK_ID, MARK_ID_BYTES, Mark, MarkKind, iter_frames, pack_mark

HELLO_TIMEOUT_S = 5.0
MARK_TIMEOUT_S = 20.0
"""The stand-in answers a tick at once; this is long enough for a debugger's breakpoint, not for ever."""
_SOCKET_BYTES = 1 << 20
_TIMEVAL = struct.Struct("@ll")
_MARK = struct.Struct("<IB3xQ")
_NO_WAIT, _WHOLE_LENGTH = int(socket.MSG_DONTWAIT), int(socket.MSG_TRUNC)
"""Plain numbers: the socket module's flags are enumerations, whose `|` costs more than the system call."""


def local_path(name: str, run_dir: Path | None = None) -> Path:
    """Where the socket of ``local:<name>`` is: absolute, or relative to the run directory."""
    path = Path(name)
    return path if path.is_absolute() else (run_dir or run_directory()) / path


class LocalChannel(Channel):
    """One connection to a bus of the stand-in; it hears all frames but its own."""

    def __init__(self, name: str, *, run_dir: Path | None = None) -> None:
        self.spec = f"local:{name}"
        self.mark_ns = 0
        """Time of the last MARK."""
        self._earlier = 0
        self._serial_bytes: dict[int, int] = {}
        self._socket = _connect(local_path(name, run_dir), self.spec)
        try:
            self.hello_ns = self._read_hello()
        except BaseException:
            self._socket.close()
            raise
        self._send_flags = 0 if self.lockstep else _NO_WAIT

    def send(self, data: bytes | bytearray | memoryview) -> None:
        try:
            self._socket.send(data, self._send_flags)
        except BlockingIOError:
            raise TransmitQueueFull(f"{self.spec}: the stand-in does not take frames; is it stopped?") from None
        except OSError as error:
            raise self._closed(error) from None

    def drain(self, buffer: bytearray, filled: int = 0) -> int:
        with memoryview(buffer) as view:
            while (end := self._receive(view, filled, _NO_WAIT)) != filled:
                filled = self._take_marks(buffer, filled, end)
        return filled

    def tick(self, t_ns: int) -> None:
        if not self.lockstep:
            super().tick(t_ns)
        # A tick to now is answered like any other, and the mark that has come before is not its answer.
        self.mark_ns = min(self.mark_ns, t_ns - 1)
        self.send(pack_mark(MarkKind.TICK, t_ns))

    def wait_mark(self, t_ns: int, buffer: bytearray, filled: int = 0) -> int:
        if not self.lockstep:
            return super().wait_mark(t_ns, buffer, filled)
        self._earlier = -1
        with memoryview(buffer) as view:
            while self.mark_ns < t_ns:
                end = self._receive(view, filled, 0)
                if end == filled:
                    raise MarkTimeout(
                        f"{self.spec}: virtual time did not reach {t_ns} ns within {MARK_TIMEOUT_S:g} s "
                        f"(it stands at {self.mark_ns} ns); is another host ticking, or the stand-in stopped?"
                    )
                filled = self._take_marks(buffer, filled, end)
        return filled

    @property
    def earlier(self) -> int:
        return max(0, self._earlier)

    @property
    def serial_bytes(self) -> dict[int, int]:
        return self._serial_bytes

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()

    def _receive(self, view: memoryview, filled: int, flags: int) -> int:
        """One packet behind ``filled``; returns ``filled`` itself when none came (at once, or within the time-out)."""
        room = len(view) - filled
        try:
            count = self._socket.recv_into(view[filled:], 0, flags | _WHOLE_LENGTH)
        except BlockingIOError:
            return filled
        except OSError as error:
            raise self._closed(error) from None
        if count == 0:
            raise self._closed(None)
        if count > room:
            raise ChannelFault(f"{self.spec}: a packet of {count} bytes does not fit the {room} left; drain more often")
        if count % FRAME_BYTES:
            raise ChannelFault(f"{self.spec}: a packet of {count} bytes is not whole frames; this is no Étude stand-in")
        return filled + count

    def _take_marks(self, buffer: bytearray, start: int, end: int) -> int:
        """Note the marks among ``buffer[start:end]`` and close the gaps they leave; returns the new end."""
        first = buffer.find(MARK_ID_BYTES, start, end)
        if first < 0:
            return end
        # Frames before the first mark stay where they are; the pattern may also stand in a frame's data.
        write = first = first - (first - start) % FRAME_BYTES
        for read in range(first, end, FRAME_BYTES):
            can_id, kind, value = _MARK.unpack_from(buffer, read)
            if can_id == MARK_ID:
                self._note(kind, value)
                if kind == MarkKind.MARK and self._earlier < 0:
                    self._earlier = write
                continue
            if write != read:
                buffer[write : write + FRAME_BYTES] = buffer[read : read + FRAME_BYTES]
            write += FRAME_BYTES
        return write

    def _note(self, kind: int, value: int) -> None:
        if kind == MarkKind.MARK:
            self.mark_ns = value
        elif kind == MarkKind.SERIAL:
            self._serial_bytes[value & 0xFFFF_FFFF] = value >> 32
        else:
            raise ChannelFault(f"{self.spec}: a mark of kind {kind} is not for a host; this is no Étude stand-in")

    def _read_hello(self) -> int | None:
        self._set_timeout(HELLO_TIMEOUT_S)
        try:
            first = self._socket.recv(FRAME_BYTES)
        except BlockingIOError:
            raise InputError(
                self.spec, f"nobody said hello within {HELLO_TIMEOUT_S:g} s", "restart the stand-in"
            ) from None
        except OSError as error:
            raise InputError(self.spec, f"the stand-in hung up ({error.strerror})", "restart the stand-in") from None
        try:
            (hello,) = iter_frames(first)
        except ValueError:
            hello = None
        if not isinstance(hello, Mark) or hello.kind is not MarkKind.HELLO:
            raise InputError(self.spec, "what listens there is no Étude stand-in", "correct the channel's path")
        self._set_timeout(MARK_TIMEOUT_S)
        self.mark_ns = hello.value
        return hello.value or None

    def _set_timeout(self, seconds: float) -> None:
        """In the kernel, so that waiting costs one system call; a passed time-out is BlockingIOError."""
        timeval = _TIMEVAL.pack(int(seconds), int(seconds % 1 * 1e6))
        for option in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):
            self._socket.setsockopt(socket.SOL_SOCKET, option, timeval)

    def _closed(self, error: OSError | None) -> ChannelClosed:
        reason = f" ({error.strerror})" if error is not None and error.errno != errno.EPIPE else ""
        return ChannelClosed(f"{self.spec}: the stand-in has left the bus{reason}; look at its output, start it again")


def _connect(path: Path, spec: str) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
        connection.setsockopt(socket.SOL_SOCKET, option, _SOCKET_BYTES)
    try:
        _connect_patiently(connection, str(path))
    except OSError as error:
        connection.close()
        if error.errno == errno.ENOENT:
            problem, remedy = f"no stand-in arm is on {path}", "start it with `etude virtual`, or `etude up --virtual`"
        elif error.errno == errno.ECONNREFUSED:
            problem, remedy = f"the stand-in arm of {path} has ended", "start it again with `etude virtual`"
        elif error.errno in (errno.EACCES, errno.EPERM):
            problem, remedy = f"no permission for {path}", "join the group that owns it, or run as its owner"
        elif error.errno == errno.EPROTOTYPE:
            problem, remedy = f"{path} is another kind of socket", "correct the channel's path"
        else:
            problem, remedy = f"cannot connect to {path} ({error.strerror or error})", "correct the channel's path"
        raise InputError(spec, problem, remedy) from None
    return connection


def _connect_patiently(connection: socket.socket, path: str) -> None:
    """A full backlog is EAGAIN on AF_UNIX: the stand-in is there but busy, so try again for a while."""
    connection.setblocking(False)
    deadline = time.monotonic() + HELLO_TIMEOUT_S
    while True:
        try:
            connection.connect(path)
        except BlockingIOError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.01)
            continue
        connection.setblocking(True)
        return
