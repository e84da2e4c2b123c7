"""The ``socketcan:`` end of a bus: one raw socket through which all our nodes on it send and hear."""

from __future__ import annotations

import errno
import socket
from collections import deque

from config import InputError
from virtual_hw.bus.frames import ERROR, FRAME_SIZE
from virtual_hw.bus.wire import Bus, Controller

_BACKLOG = 256
"""Frames kept while the interface takes no more."""


class SocketCanPort:
    """Carries our nodes' frames to the interface when their modelled transmission ends, and others' to the nodes."""

    def __init__(self, interface: str, bus: Bus) -> None:
        """
        Raises:
            InputError: no SocketCAN here, no such interface, it is down, or no permission.
        """
        self.bus = bus
        self._socket = _open(interface)
        self._controller = Controller(1, self._hear)
        self._backlog: deque[bytes] = deque(maxlen=_BACKLOG)
        bus.attach(self._controller)

    def fileno(self) -> int:
        return self._socket.fileno()

    def receive(self) -> None:
        """Give every frame that waits on the interface to the nodes; it has ended on the real bus just now."""
        while True:
            try:
                raw = self._socket.recv(FRAME_SIZE)
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno == errno.ENETDOWN:
                    return
                raise
            if len(raw) == FRAME_SIZE and not int.from_bytes(raw[:4], "little") & ERROR:
                self.bus.inject(self._controller, raw)

    def flush(self) -> None:
        """Send what is to be sent; a full interface queue keeps the rest for the next time."""
        while self._backlog:
            try:
                self._socket.send(self._backlog[0])
            except OSError as error:
                if error.errno in (errno.ENOBUFS, errno.EAGAIN):
                    return
                if error.errno != errno.ENETDOWN:
                    raise
            self._backlog.popleft()

    def tell_error(self, message: bytes) -> None:
        """Have every host hear an error message of its controller; a vcan carries error frames as any other."""
        self._backlog.append(message)

    def close(self) -> None:
        self.bus.detach(self._controller)
        self._socket.close()

    def _hear(self, _now_ns: int, raw: bytes) -> None:
        self._backlog.append(raw)


def _open(interface: str) -> socket.socket:
    place = f"socketcan:{interface}"
    try:
        sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except OSError:
        raise InputError(place, "this kernel has no SocketCAN", "use a local: channel") from None
    try:
        sock.bind((interface,))
    except OSError as error:
        sock.close()
        if error.errno == errno.ENODEV:
            remedy = f"make it: ip link add {interface} type vcan && ip link set {interface} up"
            raise InputError(place, "there is no such interface", remedy) from None
        raise InputError(place, f"cannot be used ({error.strerror})", "check the interface and permissions") from None
    sock.setblocking(False)
    return sock
