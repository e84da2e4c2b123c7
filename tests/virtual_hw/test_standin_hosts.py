"""Hosts on the stand-in's sockets: connections, ticks and marks, what is answered when."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import canopen
import pytest

from driver.bus.python_can import python_can_bus
from tests.virtual_hw.local_host import HELLO, MARK_KIND, SERIAL, Host, mark, tick
from virtual_hw.bus.frames import CAN_FRAME, MARK, MARK_ID, frame
from virtual_hw.bus.local import LocalPort
from virtual_hw.event_loop import serve
from virtual_hw.rig import Rig

START_NS = 1_700_000_000_000_000_000
READ_TYPE = struct.pack("<BHB4x", 0x40, 0x1000, 0)
RunRig = Callable[..., Rig]


class CountingSensor:
    """Carries a byte a microsecond."""

    total_bytes = 0

    def __init__(self) -> None:
        self._ends = socket.socketpair()

    def advance(self, now_ns: int) -> None:
        self.total_bytes = now_ns // 1000

    def fileno(self) -> int:
        return self._ends[0].fileno()

    def close(self) -> None:
        for end in self._ends:
            end.close()


@pytest.fixture
def run_rig(make_bench: Callable[..., Any]) -> Iterator[RunRig]:
    """Serves a rig with a double integrator for an arm, in a thread, from sockets in a directory."""
    with contextlib.ExitStack() as cleanup:

        def begin(directory: Path, *, lockstep: bool = True, sensors: Sequence[CountingSensor] = ()) -> Rig:
            installation = make_bench.installation
            arm = make_bench().arm
            rig = Rig(installation, arm, START_NS if lockstep else 0)
            rig.power_stage.connect(sensors)
            ports = [LocalPort(directory / f"dda-{bus.name}", bus) for bus in rig.buses]
            wake, waker = socket.socketpair()
            thread = threading.Thread(target=serve, args=(rig, ports, sensors, wake), kwargs={"lockstep": lockstep})

            def end() -> None:
                waker.send(b"x")
                thread.join()
                for closing in (*ports, *sensors, wake, waker):
                    closing.close()

            cleanup.callback(end)
            thread.start()
            return rig

        yield begin


def ids(heard: list[bytes]) -> list[int]:
    return [int.from_bytes(raw[:4], "little") for raw in heard if not raw.startswith(b"\xff" * 4)]


def test_hello_says_lockstep_or_wall_clock(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    with Host(tmp_path / "dda-can0") as host:
        assert MARK.unpack(host.hello) == (MARK_ID, HELLO, START_NS)
    wall = tmp_path / "wall"
    run_rig(wall, lockstep=False)
    with Host(wall / "dda-can0") as host:
        assert MARK.unpack(host.hello) == (MARK_ID, HELLO, 0)


def test_configuration_takes_no_time_in_lockstep(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    with Host(tmp_path / "dda-can1") as host:
        assert host.sdo_read(2, 0x1000) == 0x00020192
    with Host(tmp_path / "dda-can1") as again:
        assert MARK.unpack(again.hello)[2] == START_NS


def test_time_moves_by_ticks_and_a_mark_ends_what_was_heard(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    t1, t2 = START_NS + 1_000_000, START_NS + 1_400_000
    with Host(tmp_path / "dda-can0") as host:
        host.send(frame(0x000, b"\x01\x00"), tick(t1), frame(0x601, READ_TYPE), tick(t2))
        heard = host.until_mark(t2)
    first = heard.index(mark(t1))
    assert 0x581 not in ids(heard[:first])
    assert 0x581 in ids(heard[first:])


def test_serial_counts_stand_before_the_mark(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path, sensors=[CountingSensor()])
    with Host(tmp_path / "dda-can0") as host:
        host.send(tick(START_NS + 1_000_000), tick(START_NS + 1_700_000))
        heard = host.until_mark(START_NS + 1_700_000)
    kinds = [(raw[4], int.from_bytes(raw[8:], "little")) for raw in heard]
    # bytes by the ticks of 1.0 and 1.5 ms; a later byte is none of this moment
    assert kinds == [(SERIAL, 1000 << 32), (MARK_KIND, START_NS + 1_000_000), (SERIAL, 1500 << 32),
                     (MARK_KIND, START_NS + 1_700_000)]  # fmt: skip


def test_ticks_on_other_buses_date_frames_and_move_nothing(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    t1, t2 = START_NS + 1_000_000, START_NS + 1_400_000
    with Host(tmp_path / "dda-can0") as first, Host(tmp_path / "dda-can1") as second:
        second.send(frame(0x000, b"\x01\x02"))
        second.send(frame(0x600 + 2, struct.pack("<BHB4s", 0x2F, 0x1800, 2, b"\x01")))
        second.receive()
        second.send(tick(t1), frame(0x080), tick(t2))
        second.socket.settimeout(0.2)
        with pytest.raises(TimeoutError):
            second.receive()
        second.socket.settimeout(10)
        first.send(tick(t1), tick(t2))
        heard = second.until_mark(t2)
        before = heard.index(mark(t1))
        assert 0x182 not in ids(heard[:before])
        assert 0x182 in ids(heard[before:])
        first.until_mark(t2)


def test_connections_hear_each_other(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    with Host(tmp_path / "dda-can0") as host, Host(tmp_path / "dda-can0") as listener:
        host.sdo_read(1, 0x1000)
        assert ids(listener.receive()) == [0x601, 0x581]


def test_a_second_ticking_host_is_sent_away_and_the_first_goes_on(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    with Host(tmp_path / "dda-can0") as first, Host(tmp_path / "dda-can0") as second:
        first.send(tick(START_NS + 1_000_000))
        first.until_mark(START_NS + 1_000_000)
        second.until_mark(START_NS + 1_000_000)
        second.send(tick(START_NS + 2_000_000))
        assert second.socket.recv(16) == b""
        first.send(tick(START_NS + 2_000_000))
        first.until_mark(START_NS + 2_000_000)
    with Host(tmp_path / "dda-can0") as heir:
        t_ns = MARK.unpack(heir.hello)[2] + 1_000_000
        heir.send(tick(t_ns))
        heir.until_mark(t_ns)


def test_time_does_not_run_backwards(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    with Host(tmp_path / "dda-can0") as host:
        host.send(tick(START_NS - 1))
        assert host.socket.recv(16) == b""


def test_a_packet_that_is_no_whole_frames_ends_the_connection_alone(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    with Host(tmp_path / "dda-can0") as host:
        host.socket.send(b"hello")
        assert host.socket.recv(16) == b""
    with Host(tmp_path / "dda-can0") as host:
        assert host.sdo_read(1, 0x1000) == 0x00020192


def test_an_overflowing_host_is_told_by_an_error_frame(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    with Host(tmp_path / "dda-can0") as host:
        host.send(*[frame(0x300)] * 200)
        host.send(tick(START_NS + 1_000_000))
        errors = [raw for raw in host.until_mark(START_NS + 1_000_000) if raw[3] == 0x20]
        assert len(errors) == 200 - 128
        assert errors[0] == CAN_FRAME.pack(0x2000_0004, 8, bytes((0, 2, 0, 0, 0, 0, 0, 0)))


def test_between_cycles_every_bus_answers_at_once(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path)
    t_ns = START_NS + 1_000_000
    with Host(tmp_path / "dda-can0") as first, Host(tmp_path / "dda-can1") as second:
        second.send(tick(t_ns))
        first.send(tick(t_ns))
        second.until_mark(t_ns)
        assert second.sdo_read(2, 0x1000) == 0x00020192


def test_the_arm_follows_real_time_without_a_host(run_rig: RunRig, tmp_path: Path) -> None:
    rig = run_rig(tmp_path, lockstep=False)
    before, begin = rig.now_ns, time.monotonic_ns()
    with Host(tmp_path / "dda-can0") as host:
        while rig.now_ns < before + 20_000_000:
            host.sdo_read(1, 0x1000)
            assert time.monotonic_ns() < begin + 10**10


def test_canopen_works_on_it_in_wall_clock_time(run_rig: RunRig, tmp_path: Path) -> None:
    run_rig(tmp_path, lockstep=False)
    bus = python_can_bus(f"local:{tmp_path / 'dda-can0'}")
    network = canopen.Network(bus)
    network.connect()
    try:
        node = network.add_node(1, str(Path(__file__).parents[2] / "config/drives/etude402.eds"))
        assert node.sdo["Manufacturer device name"].raw == "Etude 402"
        node.sdo[0x1017].raw = 10
        node.nmt.state = "OPERATIONAL"
        node.nmt.wait_for_heartbeat(5)
        assert node.nmt.state == "OPERATIONAL"
        with pytest.raises(canopen.SdoAbortedError) as refused:
            node.sdo[0x605A].raw = 9
        assert refused.value.code == 0x06090031
        node.sdo[0x6060].raw = 10
        node.sdo[0x6040].raw = 0x06
        deadline = time.monotonic() + 5
        while node.sdo[0x6041].raw & 0x6F != 0x21:
            assert time.monotonic() < deadline
    finally:
        network.disconnect()
