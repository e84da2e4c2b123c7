"""Real and virtual CAN interfaces of the kernel, as a raw AF_CAN socket."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import socket
import struct

from config.errors import InputError
from driver.bus.channel import Channel
from driver.bus.errors import ChannelClosed, ChannelFault, TransmitQueueFull
from driver.bus.frames import FRAME_BYTES

_SIOCGIFFLAGS = 0x8913
_IFF_UP = 0x1
_IFREQ = struct.Struct("16sH22x")
_SO_RXQ_OVFL = 40
_CAN_RAW_ERR_FILTER = 2
_ERROR_CLASSES = 0x1FFF_FFFF & ~0x002
"""All error classes but lost arbitration, which is normal on a shared bus."""
_RECEIVE_BYTES = 1 << 20
_DROPPED = struct.Struct("=I")
_ANCILLARY_BYTES = socket.CMSG_SPACE(_DROPPED.size)
_GONE = (errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EBADF)


class SocketCanChannel(Channel):
    """One raw socket on one interface; classic CAN, error frames enabled."""

    def __init__(self, interface: str) -> None:
        self.interface, self.spec = interface, f"socketcan:{interface}"
        self.rx_overflow = 0
        self._socket = _open(interface, self.spec)

    def send(self, data: bytes | bytearray | memoryview) -> None:
        send = self._socket.send
        try:
            if len(data) == FRAME_BYTES:
                send(data)
                return
            with memoryview(data) as view:
                for offset in range(0, len(view), FRAME_BYTES):
                    send(view[offset : offset + FRAME_BYTES])
        except OSError as error:
            if error.errno in (errno.ENOBUFS, errno.EAGAIN):
                raise TransmitQueueFull(
                    f"{self.spec}: the transmit queue is full; is another node on the bus, powered and "
                    f"at this bit rate (otherwise raise `ip link set {self.interface} txqueuelen`)?"
                ) from None
            raise self._fault(error) from None

    def drain(self, buffer: bytearray, filled: int = 0) -> int:
        with memoryview(buffer) as view:
            room = len(view) - FRAME_BYTES
            try:
                # The kernel stamps its count of dropped frames on every frame; one look a drain is enough.
                if filled > room:
                    return filled
                count, ancillary, _, _ = self._socket.recvmsg_into(
                    [view[filled : filled + FRAME_BYTES]], _ANCILLARY_BYTES
                )
                self._check_whole(count)
                for level, kind, value in ancillary:
                    if level == socket.SOL_SOCKET and kind == _SO_RXQ_OVFL:
                        (self.rx_overflow,) = _DROPPED.unpack(value)
                filled += count
                receive = self._socket.recv_into
                while filled <= room:
                    count = receive(view[filled:], FRAME_BYTES)
                    self._check_whole(count)
                    filled += count
            except BlockingIOError:
                pass
            except OSError as error:
                raise self._fault(error) from None
        return filled

    def fileno(self) -> int:
        return self._socket.fileno()

    def close(self) -> None:
        self._socket.close()

    def _check_whole(self, count: int) -> None:
        if count != FRAME_BYTES:
            raise ChannelFault(f"{self.spec}: {count} bytes are no classic CAN frame")

    def _fault(self, error: OSError) -> ChannelFault:
        if error.errno in _GONE:
            return ChannelClosed(
                f"{self.spec}: the interface went down; look at `ip -details link show {self.interface}`, bring it up"
            )
        return ChannelFault(f"{self.spec}: {error.strerror or error}")


def _open(interface: str, spec: str) -> socket.socket:
    try:
        raw = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    except PermissionError:
        raise InputError(
            spec, "no permission to open CAN sockets", "run it outside the sandbox that forbids them"
        ) from None
    except OSError as error:
        if error.errno in (errno.EAFNOSUPPORT, errno.EPROTONOSUPPORT):
            raise InputError(
                spec, "this kernel has no SocketCAN", "run `modprobe can_raw`, or use the stand-in's local:<path>"
            ) from None
        raise InputError(spec, f"cannot open a CAN socket ({error.strerror})") from None
    try:
        _require_up(raw, interface, spec)
        raw.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, _ERROR_CLASSES)
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BYTES)
        with contextlib.suppress(OSError):  # Absent in some small kernels: then overflow shows as missing frames.
            raw.setsockopt(socket.SOL_SOCKET, _SO_RXQ_OVFL, 1)
        raw.bind((interface,))
        raw.setblocking(False)
    except OSError as error:
        raw.close()
        if error.errno == errno.ENODEV:
            raise InputError(spec, f"{interface} is not a CAN interface", "correct the channel") from None
        if error.errno in (errno.EACCES, errno.EPERM):
            raise InputError(spec, f"no permission for {interface}", "run as a user who may use it") from None
        raise InputError(
            spec, f"cannot use {interface} ({error.strerror})", f"look at `ip link show {interface}`"
        ) from None
    except InputError:
        raw.close()
        raise
    return raw


def _require_up(raw: socket.socket, interface: str, spec: str) -> None:
    name = interface.encode()
    if len(name) > 15:
        raise InputError(spec, f"{interface!r} is longer than the 15 bytes of an interface name", "correct the channel")
    try:
        answer = fcntl.ioctl(raw, _SIOCGIFFLAGS, _IFREQ.pack(name, 0))
    except OSError as error:
        if error.errno != errno.ENODEV:
            raise
        if interface.startswith("vcan"):
            remedy = f"make it with `ip link add dev {interface} type vcan && ip link set {interface} up`"
        else:
            remedy = (
                f"plug the adapter in, then `ip link set {interface} up type can bitrate 1000000` "
                "(`ip link` lists what is there)"
            )
        raise InputError(spec, f"there is no interface {interface}", remedy) from None
    if not _IFREQ.unpack(answer)[1] & _IFF_UP:
        remedy = f"`ip link set {interface} up" + (
            "`" if interface.startswith("vcan") else " type can bitrate 1000000`"
        )
        raise InputError(spec, f"{interface} is down", f"bring it up with {remedy}")
