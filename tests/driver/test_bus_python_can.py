"""The python-can plug-in on a hand-played local bus."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from config import InputError
from driver.bus.frames import EXTENDED_FLAG, REMOTE_FLAG, MarkKind, pack, pack_mark
from driver.bus.python_can import LocalBus, python_can_bus

NOON = 1_700_000_000_000_000_000


class Wire:
    """Accepts one connection in a thread of its own and greets it."""

    def __init__(self, path: Path, hello_ns: int) -> None:
        self.path = path
        self.listening = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.listening.bind(str(path))
        self.listening.listen()
        self._hello = pack_mark(MarkKind.HELLO, hello_ns)
        self._greeting = threading.Thread(target=self._greet)
        self._greeting.start()

    def _greet(self) -> None:
        self.connection, _ = self.listening.accept()
        self.connection.send(self._hello)

    def close(self) -> None:
        self._greeting.join()
        self.connection.close()
        self.listening.close()


@pytest.fixture
def wire(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Wire]:
    wire = Wire(tmp_path / "bus", getattr(request, "param", 0))
    yield wire
    wire.close()


@pytest.fixture
def bus(wire: Wire) -> Iterator[can.BusABC]:
    bus = python_can_bus(f"local:{wire.path}")
    wire._greeting.join()
    yield bus
    bus.shutdown()


def test_messages_both_ways(wire: Wire, bus: can.BusABC) -> None:
    bus.send(can.Message(arbitration_id=0x601, is_extended_id=False, data=b"\x40\x00\x10\x00"))
    bus.send(can.Message(arbitration_id=0x1ABCDEF, is_extended_id=True, data=b""))
    bus.send(can.Message(arbitration_id=0x702, is_extended_id=False, is_remote_frame=True))
    assert wire.connection.recv(64) == pack(0x601, b"\x40\x00\x10\x00")
    assert wire.connection.recv(64) == pack(0x1ABCDEF | EXTENDED_FLAG)
    assert wire.connection.recv(64) == pack(0x702 | REMOTE_FLAG)
    wire.connection.send(pack(0x581, b"\x43") + pack(0x701, b"\x05"))
    first, second = bus.recv(1.0), bus.recv(1.0)
    assert first is not None
    assert second is not None
    assert (first.arbitration_id, bytes(first.data), first.is_extended_id) == (0x581, b"\x43", False)
    assert (second.arbitration_id, bytes(second.data)) == (0x701, b"\x05")
    assert bus.recv(0.0) is None


@pytest.mark.parametrize("wire", [NOON], indirect=True)
def test_in_lockstep_messages_bear_the_time_of_the_last_mark(wire: Wire, bus: LocalBus) -> None:
    assert bus.lockstep
    wire.connection.send(pack_mark(MarkKind.MARK, NOON + 2_000_000_000) + pack(0x181))
    message = bus.recv(1.0)
    assert message is not None
    assert message.timestamp == 1_700_000_002.0


def test_the_plug_in_is_found_by_name(wire: Wire) -> None:
    try:
        bus = can.Bus(interface="etude_local", channel=str(wire.path))
    except can.CanInterfaceNotImplementedError:
        # Let the fixture's thread end before the skip.
        LocalBus(str(wire.path)).shutdown()
        pytest.skip("the distribution is not installed, so its entry points are not registered")
    with bus:
        assert isinstance(bus, LocalBus)


def test_filters_of_python_can_work(wire: Wire, bus: can.BusABC) -> None:
    bus.set_filters([{"can_id": 0x700, "can_mask": 0x780}])
    wire.connection.send(pack(0x181) + pack(0x701, b"\x05"))
    message = bus.recv(1.0)
    assert message is not None
    assert message.arbitration_id == 0x701


def test_a_dead_bus_is_an_operation_error(wire: Wire, bus: can.BusABC) -> None:
    wire.connection.close()
    with pytest.raises(can.CanOperationError, match="has left the bus"):
        bus.recv(1.0)
    with pytest.raises(can.CanOperationError, match="has left the bus"):
        bus.send(can.Message(arbitration_id=0x80, is_extended_id=False))


@pytest.mark.parametrize("spec", ["socketcan:", "local:", "virtual:0"])
def test_specs_that_name_no_channel(spec: str) -> None:
    with pytest.raises(InputError, match="is not a CAN channel"):
        python_can_bus(spec)


def test_can_fd_is_refused(bus: can.BusABC) -> None:
    with pytest.raises(can.CanOperationError, match="classic CAN"):
        bus.send(can.Message(arbitration_id=1, is_fd=True, is_extended_id=False))
