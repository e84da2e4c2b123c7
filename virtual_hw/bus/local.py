"""The ``local:`` end of a bus: a listening packet socket, each connection a CAN controller of a host."""

from __future__ import annotations

import contextlib
import errno
import socket
import stat
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from config import InputError
from virtual_hw.bus.frames import CAN_FRAME, FRAME_SIZE, MARK, MARK_ID, error_frame
from virtual_hw.bus.wire import Bus, Controller

TICK, MARK_KIND, SERIAL, HELLO = 1, 2, 3, 4
"""Kinds of marks (docs/architecture.md)."""

HOST_QUEUE = 128
"""Transmit queue of a host's controller, frames."""
_SOCKET_BUFFER = 1 << 20
_PACKET_LIMIT = 64 * 1024
_CONTROLLER_PROBLEM = 0x04
_TRANSMIT_OVERFLOW = bytes((0, 0x02, 0, 0, 0, 0, 0, 0))
_RECEIVE_OVERFLOW = bytes((0, 0x01, 0, 0, 0, 0, 0, 0))
_NO_WAIT = int(socket.MSG_DONTWAIT)
_MARK_ID_BYTES = MARK_ID.to_bytes(4, "little")


def mark(kind: int, value: int) -> bytes:
    """A mark: ``value`` is a little-endian u64."""
    return MARK.pack(MARK_ID, kind, value)


class Connection:
    """One host's controller: what it sent and is not yet dated, and what it is still to be told."""

    def __init__(self, sock: socket.socket, bus: Bus, hello_ns: int) -> None:
        self.sock = sock
        self.bus = bus
        self.controller = Controller(HOST_QUEUE, self._hear)
        self.inbox: deque[bytes] = deque()
        """Frames and TICK marks in the order they came; `release` moves frames on to the bus."""
        self.alive = True
        """Whether the host is still there and speaks whole frames."""
        self._outbox: list[bytes] = [mark(HELLO, hello_ns)]
        self._overrun = False
        bus.attach(self.controller)
        self.flush()

    def receive(self) -> bool:
        """Read one packet into `inbox`; False when there is none. A host that has gone is no longer `alive`."""
        packet = self.read()
        self.take(packet)
        return bool(packet)

    def read(self) -> bytes:
        """One packet of whole frames as it came; empty when there is none."""
        try:
            packet = self.sock.recv(_PACKET_LIMIT, _NO_WAIT)
        except BlockingIOError:
            return b""
        except OSError:
            packet = b""
        if not packet or len(packet) % FRAME_SIZE:
            self.alive = False
            return b""
        return packet

    def take(self, packet: bytes) -> None:
        """Put the frames of a packet into `inbox`."""
        self.inbox.extend([packet[k : k + FRAME_SIZE] for k in range(0, len(packet), FRAME_SIZE)])

    def transmit(self, raw: bytes) -> None:
        """Queue a frame of the host on the bus; a full queue is told to it as the error frame SocketCAN has.

        Error frames are for hosts to hear, not to send: they go nowhere.
        """
        if raw[3] & 0xE0 == 0x20:
            return
        if raw[4] > 8:
            raw = CAN_FRAME.pack(int.from_bytes(raw[:4], "little"), 8, raw[8:])
        if not self.bus.send(self.controller, raw):
            self._outbox.append(error_frame(_CONTROLLER_PROBLEM, _TRANSMIT_OVERFLOW))

    def tell(self, mark_bytes: bytes) -> None:
        """Add marks behind everything heard so far; `flush` sends."""
        self._outbox.append(mark_bytes)

    def hear_block(self, frames: Sequence[bytes]) -> None:
        """Hear frames one after the other."""
        self._outbox += frames

    def flush(self) -> None:
        """Send what was heard since the last flush as one packet.

        A host that does not read loses frames, as it would in its own receive queue, and is told when it reads again.
        """
        if not self._outbox:
            return
        packet = b"".join(self._outbox)
        self._outbox.clear()
        if self._overrun:
            packet = error_frame(_CONTROLLER_PROBLEM, _RECEIVE_OVERFLOW) + packet
        try:
            self.sock.send(packet, _NO_WAIT)
        except BlockingIOError:
            self._overrun = True
        except OSError:
            self.alive = False
        else:
            self._overrun = False

    def close(self) -> None:
        self.bus.detach(self.controller)
        self.sock.close()

    def _hear(self, _now_ns: int, raw: bytes) -> None:
        self._outbox.append(raw)


class LocalPort:
    """The listening socket of one bus."""

    def __init__(self, path: Path, bus: Bus) -> None:
        """
        Raises:
            InputError: another stand-in listens there, the path is taken by something else, or not writable.
        """
        self.path = path
        self.bus = bus
        self.connections: list[Connection] = []
        self._listener = _listen(path)
        self._identity = _identity(path)

    def fileno(self) -> int:
        return self._listener.fileno()

    def accept(self, hello_ns: int) -> Connection | None:
        """Take a waiting connection and say HELLO (virtual time, or 0 for wall clock)."""
        try:
            sock, _ = self._listener.accept()
        except OSError:
            return None
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SOCKET_BUFFER)
        connection = Connection(sock, self.bus, hello_ns)
        self.connections.append(connection)
        return connection

    def flush(self) -> list[Connection]:
        """Send every host what it is to be told; returns those that have gone, for `drop`."""
        gone = []
        for connection in self.connections:
            connection.flush()
            if not connection.alive:
                gone.append(connection)
        return gone

    def tell_error(self, message: bytes) -> None:
        """Have every host hear an error message of its controller."""
        for connection in self.connections:
            connection.tell(message)

    def drop(self, connection: Connection) -> None:
        self.connections.remove(connection)
        connection.close()

    def close(self) -> None:
        """Close everything; the socket file goes unless somebody else has put another in its place."""
        for connection in self.connections:
            connection.close()
        self.connections.clear()
        self._listener.close()
        if _identity(self.path) == self._identity:
            self.path.unlink()


def is_mark(raw: bytes) -> bool:
    return raw[:4] == _MARK_ID_BYTES


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


def _listen(path: Path) -> socket.socket:
    place = f"local:{path}"
    _clear_leftover(path, place)
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        listener.bind(str(path))
        path.chmod(0o660)
        listener.listen(16)
    except OSError as error:
        listener.close()
        problem, remedy = f"cannot listen ({error.strerror or error})", "check the path and who may write there"
        raise InputError(place, problem, remedy) from None
    listener.setblocking(False)
    return listener


def _clear_leftover(path: Path, place: str) -> None:
    """Remove the socket of a stand-in that died; refuse when one is alive or the file is something else."""
    try:
        if not stat.S_ISSOCK(path.lstat().st_mode):
            raise InputError(place, "the path is taken by a file that is no socket", "choose another path for the bus")
    except OSError:
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as probe:
        probe.setblocking(False)
        refused = probe.connect_ex(str(path))
    if refused == errno.ECONNREFUSED:
        with contextlib.suppress(OSError):
            path.unlink()
        return
    raise InputError(place, "another stand-in arm runs on this bus", "stop it first, or use its arm")
