"""The ground the integration tests stand on: raw SocketCAN frames, and python-can on them."""

from __future__ import annotations

import socket
import struct

import can
import pytest

pytestmark = pytest.mark.vcan


def raw_socket() -> socket.socket:
    try:
        s = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        s.bind(("vcan0",))
    except OSError as error:
        pytest.skip(f"no vcan0 here ({error}); make test-vcan brings one")
    s.settimeout(1)
    return s


def test_a_frame_crosses() -> None:
    frame = struct.pack("<IB3x8s", 0x181, 8, bytes(range(8)))
    with raw_socket() as a, raw_socket() as b:
        a.send(frame)
        assert b.recv(16) == frame


def test_python_can_hears_a_raw_frame() -> None:
    with raw_socket() as a, can.Bus(interface="socketcan", channel="vcan0") as bus:
        a.send(struct.pack("<IB3x8s", 0x80, 0, b""))
        message = bus.recv(1)
    assert message is not None
    assert message.arbitration_id == 0x80
