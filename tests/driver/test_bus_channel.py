"""Channels: the local bus against a listening socket played by the test, and every way not to get a channel."""

from __future__ import annotations

import errno
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from config import InputError
from driver.bus.channel import Channel, open_channel
from driver.bus.errors import ChannelClosed, ChannelFault, TransmitQueueFull
from driver.bus.frames import MarkKind, pack, pack_mark
from driver.bus.local import LocalChannel

NOON = 1_700_000_000_000_000_000


class Peer:
    """The stand-in's side of one connection, played by hand."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._listening.bind(str(path))
        self._listening.listen()
        self.connection: socket.socket | None = None

    def channel(self, hello: bytes) -> Channel:
        """Connect a channel, with ``hello`` waiting for it already: connecting does not wait for accept."""
        client = socket.socket
        opened: list[Channel] = []

        def connect_and_greet(self_: socket.socket, address: str) -> None:
            client.connect(self_, address)
            self.connection, _ = self._listening.accept()
            self.connection.sendall(hello)

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("driver.bus.local._connect_patiently", connect_and_greet)
            opened.append(open_channel(f"local:{self.path}"))
        return opened[0]

    def send(self, *frames: bytes) -> None:
        assert self.connection is not None
        self.connection.send(b"".join(frames))

    def receive(self) -> bytes:
        assert self.connection is not None
        return self.connection.recv(1 << 16)

    def close(self) -> None:
        if self.connection is not None:
            self.connection.close()
        self._listening.close()


@pytest.fixture
def peer(tmp_path: Path) -> Iterator[Peer]:
    peer = Peer(tmp_path / "bus")
    yield peer
    peer.close()


@pytest.fixture
def wall(peer: Peer) -> Iterator[Channel]:
    with peer.channel(pack_mark(MarkKind.HELLO, 0)) as channel:
        yield channel


@pytest.fixture
def lockstep(peer: Peer) -> Iterator[Channel]:
    with peer.channel(pack_mark(MarkKind.HELLO, NOON)) as channel:
        yield channel


def test_wall_clock_and_lockstep_by_the_hello(peer: Peer) -> None:
    with peer.channel(pack_mark(MarkKind.HELLO, 0)) as channel:
        assert not channel.lockstep
        with pytest.raises(ChannelFault, match="wall-clock"):
            channel.tick(NOON)
        with pytest.raises(ChannelFault, match="no marks"):
            channel.wait_mark(NOON, bytearray(64))
    with peer.channel(pack_mark(MarkKind.HELLO, NOON)) as channel:
        assert channel.lockstep
        assert channel.hello_ns == NOON


def test_frames_go_both_ways_in_order(peer: Peer, wall: Channel) -> None:
    wall.send(pack(0x201, b"\x0f\x00") + pack(0x080))
    assert peer.receive() == pack(0x201, b"\x0f\x00") + pack(0x080)
    peer.send(pack(0x181, b"\x01"))
    peer.send(pack(0x182, b"\x02"), pack(0x183, b"\x03"))
    buffer = bytearray(256)
    end = wall.drain(buffer)
    assert buffer[:end] == pack(0x181, b"\x01") + pack(0x182, b"\x02") + pack(0x183, b"\x03")
    assert wall.drain(buffer) == 0


def test_draining_goes_on_behind_what_is_there(peer: Peer, wall: Channel) -> None:
    buffer = bytearray(256)
    buffer[:16] = pack(0x701, b"\x05")
    peer.send(pack(0x181))
    assert wall.drain(buffer, 16) == 32
    assert buffer[:32] == pack(0x701, b"\x05") + pack(0x181)


frames = st.builds(pack, st.integers(0, 0x7FF), st.binary(max_size=8) | st.just(b"\xff" * 8))
marks = st.builds(
    pack_mark,
    st.sampled_from((MarkKind.MARK, MarkKind.SERIAL)),
    st.integers(0, 2**64 - 1),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
@given(st.lists(st.lists(frames | marks, min_size=1, max_size=12), max_size=4))
def test_marks_never_reach_the_reader(peer: Peer, lockstep: Channel, packets: list[list[bytes]]) -> None:
    for packet in packets:
        peer.send(*packet)
    buffer = bytearray(2048)
    end = lockstep.drain(buffer)
    sent = [frame for packet in packets for frame in packet if not frame.startswith(b"\xff\xff\xff\xff")]
    assert buffer[:end] == b"".join(sent)


def test_a_tick_waits_for_its_mark(peer: Peer, lockstep: Channel) -> None:
    lockstep.tick(NOON + 1000)
    assert peer.receive() == pack_mark(MarkKind.TICK, NOON + 1000)
    peer.send(pack(0x181), pack_mark(MarkKind.MARK, NOON + 500))
    peer.send(pack(0x182), pack_mark(MarkKind.SERIAL, 37 << 32 | 1), pack_mark(MarkKind.MARK, NOON + 1000))
    peer.send(pack(0x183))
    buffer = bytearray(256)
    end = lockstep.wait_mark(NOON + 1000, buffer)
    assert buffer[:end] == pack(0x181) + pack(0x182)
    assert lockstep.serial_bytes == {1: 37}
    assert lockstep.drain(buffer) == 16


def test_a_mark_that_never_comes_is_named(peer: Peer, lockstep: LocalChannel) -> None:
    lockstep._set_timeout(0.01)
    with pytest.raises(ChannelFault, match="virtual time did not reach"):
        lockstep.wait_mark(NOON + 1, bytearray(64))


def test_the_end_of_the_other_side_is_told(peer: Peer, wall: Channel) -> None:
    peer.send(pack(0x181))
    peer.close()
    with pytest.raises(ChannelClosed, match="has left the bus"):
        wall.drain(bytearray(256))
    with pytest.raises(ChannelClosed, match="has left the bus"):
        wall.send(pack(0x080))


def test_a_bus_that_takes_nothing_is_told(peer: Peer, wall: Channel) -> None:
    with pytest.raises(TransmitQueueFull, match="does not take frames"):
        for _ in range(100_000):
            wall.send(pack(0x080) * 64)


def test_what_does_not_fit_is_told_not_cut(peer: Peer, wall: Channel) -> None:
    peer.send(*[pack(0x181)] * 5)
    with pytest.raises(ChannelFault, match="80 bytes does not fit the 64"):
        wall.drain(bytearray(64))


@pytest.mark.parametrize("packet", [b"\x00" * 15, pack(0x181) + b"\x00", pack_mark(MarkKind.TICK, 1)])
def test_no_stand_in_speaks_like_this(peer: Peer, wall: Channel, packet: bytes) -> None:
    peer.send(packet)
    with pytest.raises(ChannelFault, match="no Étude stand-in"):
        wall.drain(bytearray(256))


@pytest.mark.parametrize("hello", [pack(0x701), b"hello", pack_mark(MarkKind.MARK, 1)])
def test_a_stranger_is_refused_at_the_door(peer: Peer, hello: bytes) -> None:
    with pytest.raises(InputError, match="no Étude stand-in"):
        peer.channel(hello)


def test_relative_paths_start_at_the_run_directory(peer: Peer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ETUDE_RUN", str(peer.path.parent))
    monkeypatch.setattr("driver.bus.local.HELLO_TIMEOUT_S", 0.01)
    with pytest.raises(InputError, match="nobody said hello"):
        open_channel("local:bus")
    with pytest.raises(InputError, match="nobody said hello"):
        open_channel("local:bus", run_dir=peer.path.parent)


def test_no_stand_in(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no stand-in arm is on .*etude virtual"):
        open_channel(f"local:{tmp_path}/nothing")


def test_a_stand_in_that_has_ended(peer: Peer) -> None:
    peer.close()
    with pytest.raises(InputError, match=r"has ended; start it again"):
        open_channel(f"local:{peer.path}")


def test_another_kind_of_socket(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as stream:
        stream.bind(str(tmp_path / "stream"))
        stream.listen()
        with pytest.raises(InputError, match="another kind of socket"):
            open_channel(f"local:{tmp_path}/stream")


def test_a_path_too_long_for_a_socket(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="too long"):
        open_channel(f"local:{tmp_path}/{'x' * 120}")


@pytest.mark.parametrize("spec", ["can0", "socketcan:", "local:", "slcan:/dev/ttyACM0", ""])
def test_specs_that_name_no_channel(spec: str) -> None:
    with pytest.raises(InputError, match="is not a CAN channel"):
        open_channel(spec)


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (errno.EAFNOSUPPORT, "this kernel has no SocketCAN; run `modprobe can_raw`"),
        (errno.EPERM, "no permission to open CAN sockets"),
        (errno.EMFILE, "cannot open a CAN socket"),
    ],
)
def test_socketcan_that_cannot_be_opened(monkeypatch: pytest.MonkeyPatch, number: int, sentence: str) -> None:
    def refuse(*_: object) -> None:
        raise OSError(number, "refused")

    monkeypatch.setattr(socket, "socket", refuse)
    with pytest.raises(InputError, match=sentence):
        open_channel("socketcan:can0")


def test_socketcan_interfaces_that_are_not_there_or_no_can(monkeypatch: pytest.MonkeyPatch) -> None:
    # The kernel answers the question for an interface's flags on any socket.
    plain = socket.socket

    def any_socket(*_: object) -> socket.socket:
        return plain(socket.AF_INET, socket.SOCK_DGRAM)

    monkeypatch.setattr(socket, "socket", any_socket)
    with pytest.raises(InputError, match=r"there is no interface vcan9; make it with `ip link add dev vcan9 type vcan"):
        open_channel("socketcan:vcan9")
    with pytest.raises(InputError, match=r"there is no interface can9; plug the adapter in"):
        open_channel("socketcan:can9")
    with pytest.raises(InputError, match="longer than the 15 bytes"):
        open_channel("socketcan:a-name-of-17-byte")
    with pytest.raises(InputError, match="cannot use lo"):
        open_channel("socketcan:lo")


@pytest.fixture
def socketcan(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Channel, socket.socket]]:
    """The channel on one end of a datagram pair, which keeps frames apart as AF_CAN does."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    ours.setblocking(False)
    monkeypatch.setattr("driver.bus.socketcan._open", lambda *_: ours)
    with open_channel("socketcan:can0") as channel, theirs:
        yield channel, theirs


def test_socketcan_sends_frame_by_frame(socketcan: tuple[Channel, socket.socket]) -> None:
    channel, wire = socketcan
    channel.send(pack(0x080))
    channel.send(bytearray(pack(0x201, b"\x0f") + pack(0x202, b"\x06")))
    assert [wire.recv(64) for _ in range(3)] == [pack(0x080), pack(0x201, b"\x0f"), pack(0x202, b"\x06")]


def test_socketcan_drains_what_is_there(socketcan: tuple[Channel, socket.socket]) -> None:
    channel, wire = socketcan
    buffer = bytearray(40)
    assert channel.drain(buffer) == 0
    for node in (1, 2, 3):
        wire.send(pack(0x180 + node))
    assert channel.drain(buffer) == 32
    assert buffer[:32] == pack(0x181) + pack(0x182)
    assert channel.drain(buffer) == 16


def test_socketcan_refuses_what_is_no_classic_frame(socketcan: tuple[Channel, socket.socket]) -> None:
    channel, wire = socketcan
    wire.send(bytes(10))
    with pytest.raises(ChannelFault, match="no classic CAN frame"):
        channel.drain(bytearray(64))


@pytest.mark.parametrize(
    ("number", "kind", "sentence"),
    [
        (errno.ENOBUFS, TransmitQueueFull, "the transmit queue is full"),
        (errno.ENETDOWN, ChannelClosed, "the interface went down"),
        (errno.EINVAL, ChannelFault, "Invalid argument"),
    ],
)
def test_socketcan_failures_in_use(
    monkeypatch: pytest.MonkeyPatch, number: int, kind: type[ChannelFault], sentence: str
) -> None:
    class Broken:
        def send(self, _: bytes) -> None:
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr("driver.bus.socketcan._open", lambda *_: Broken())
    with pytest.raises(kind, match=sentence):
        open_channel("socketcan:can0").send(pack(0x080))
