"""The SocketCAN end of a bus, on a packet socket in an interface's place."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from config import InputError
from virtual_hw.bus import socketcan
from virtual_hw.bus.frames import CAN_FRAME, ERROR, frame
from virtual_hw.bus.wire import Bus, Controller


@pytest.fixture
def interface(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    ours, others = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in (ours, others):
        end.setblocking(False)
    monkeypatch.setattr(socketcan, "_open", lambda _name: ours)
    with ours, others:
        yield others


def test_frames_leave_at_the_end_of_their_transmission(interface: socket.socket) -> None:
    bus = Bus("can0", 1_000_000, 0)
    node = Controller(8)
    port = socketcan.SocketCanPort("can0", bus)
    bus.send(node, frame(0x182))
    bus.send(node, frame(0x181, bytes(8)))
    bus.run_until(60_000)
    port.flush()
    with pytest.raises(BlockingIOError):
        interface.recv(16)
    bus.run_until(1_000_000)
    port.flush()
    assert [interface.recv(16)[:2] for _ in range(2)] == [b"\x81\x01", b"\x82\x01"]


def test_the_nodes_hear_the_interface_and_nothing_goes_back(interface: socket.socket) -> None:
    bus = Bus("can0", 1_000_000, 0)
    heard: list[bytes] = []
    bus.listen(0x601, Controller(8), lambda _t, raw: heard.append(raw))
    port = socketcan.SocketCanPort("can0", bus)
    interface.send(frame(0x601, b"\x40"))
    interface.send(CAN_FRAME.pack(ERROR | 0x601, 8, bytes(8)))
    port.receive()
    port.flush()
    assert heard == [frame(0x601, b"\x40")]
    with pytest.raises(BlockingIOError):
        interface.recv(16)


def test_an_interface_that_is_not_there_is_named() -> None:
    with pytest.raises(
        InputError, match=r"socketcan:nosuch0: (there is no such interface|this kernel has no SocketCAN)"
    ):
        socketcan.SocketCanPort("nosuch0", Bus("can0", 1_000_000, 0))
