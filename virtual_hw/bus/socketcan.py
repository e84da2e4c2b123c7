"""The ``socketcan:`` end of a bus: one raw socket through which all our nodes on it send and hear."""

from __future__ import annotations

import errno
import select
import socket
from collections import deque

from config import InputError
from virtual_hw.bus.frames import ERROR, FRAME_SIZE
from virtual_hw.bus.wire import Bus, Controller

_BACKLOG = 256
"""Frames kept while the interface takes no more."""
_GONE = (errno.ENETDOWN, errno.ENODEV, errno.ENXIO)


class SocketCanPort:
    """Carries our nodes' frames to the interface when their modelled transmission ends, and others' to the nodes."""

    def __init__(self, interface: str, bus: Bus) -> None:
        """
        Raises:
            InputError: no SocketCAN here, no such interface, or no permission.
        """
        self.bus = bus
        self.interface = interface
        self._socket = _open(interface)
        # Another socket serves the interface once it has been away; whoever waits for this port waits on.
        self._ready = select.epoll()
        self._ready.register(self._socket, select.EPOLLIN)
        self._away = False
        """The interface does not exist any more."""
        self._controller = Controller(1, self._hear)
        self._backlog: deque[bytes] = deque(maxlen=_BACKLOG)
        bus.attach(self._controller)

    def fileno(self) -> int:
        return self._ready.fileno()

    def receive(self) -> None:
        """Give every frame that waits on the interface to the nodes; it has ended on the real bus just now."""
        while True:
            try:
                raw = self._socket.recv(FRAME_SIZE)
            except BlockingIOError:
                return
            except OSError as error:
                self._look_at(error)
                return
            if len(raw) == FRAME_SIZE and not int.from_bytes(raw[:4], "little") & ERROR:
                self.bus.inject(self._controller, raw)

    def flush(self) -> None:
        """Send what is to be sent; a full interface queue keeps the rest for the next time. An interface that is down
        or away takes nothing; it is taken up again when it is back."""
        if self._away and not self._back():
            self._backlog.clear()
        while self._backlog:
            try:
                self._socket.send(self._backlog[0])
            except OSError as error:
                if error.errno in (errno.ENOBUFS, errno.EAGAIN):
                    return
                self._look_at(error)
            self._backlog.popleft()

    def tell_error(self, message: bytes) -> None:
        """Have every host hear an error message of its controller; a vcan carries error frames as any other."""
        self._backlog.append(message)

    def close(self) -> None:
        self.bus.detach(self._controller)
        self._ready.close()
        self._socket.close()

    def _look_at(self, error: OSError) -> None:
        """Whoever asks the socket next is told of its end, once."""
        if error.errno not in _GONE:
            raise error
        self._away = self._away or error.errno != errno.ENETDOWN

    def _back(self) -> bool:
        """Whether the interface is there again. A socket whose interface was deleted hears nothing of the new one."""
        try:
            fresh = _open(self.interface)
        except InputError:
            return False
        self._ready.unregister(self._socket)
        self._socket.close()
        self._socket = fresh
        self._ready.register(fresh, select.EPOLLIN)
        self._away = False
        return True

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
