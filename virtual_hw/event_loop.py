"""Waits for hosts, sensors' lines and time, and hands each to the clock that the stand-in runs on."""

from __future__ import annotations

import select
import socket
from collections.abc import Sequence

from virtual_hw.bus.local import Connection, LocalPort
from virtual_hw.bus.socketcan import SocketCanPort
from virtual_hw.drive.power_stage import SerialSensor
from virtual_hw.lockstep import Lockstep
from virtual_hw.rig import Rig
from virtual_hw.wall_clock import WallClock


def serve(
    rig: Rig,
    ports: Sequence[LocalPort | SocketCanPort],
    sensors: Sequence[SerialSensor],
    wake: socket.socket,
    *,
    lockstep: bool,
) -> None:
    """The event loop: until ``wake`` is readable, hosts are accepted and served, and time moves."""
    epoll = select.epoll()
    sources: dict[int, LocalPort | SocketCanPort | Connection | SerialSensor] = {}
    sources.update({port.fileno(): port for port in ports})
    sources.update({sensor.fileno(): sensor for sensor in sensors})
    for descriptor in sources:
        epoll.register(descriptor, select.EPOLLIN)
    epoll.register(wake.fileno(), select.EPOLLIN)
    clock: Lockstep | WallClock
    if lockstep:
        clock = Lockstep(rig, [port for port in ports if isinstance(port, LocalPort)])
    else:
        clock = WallClock(rig, ports)
    with epoll:
        while True:
            if isinstance(clock, WallClock):
                # epoll's own time-out counts milliseconds; select's on the epoll descriptor counts microseconds.
                woken, _, _ = select.select([epoll], [], [], clock.seconds_to_next_event())
                clock.advance()
                events = epoll.poll(0) if woken else []
            else:
                events = epoll.poll(0 if clock.follow() else -1)
            for descriptor, _ in events:
                if descriptor == wake.fileno():
                    return
                source = sources[descriptor]
                if isinstance(source, LocalPort):
                    connection = source.accept(clock.hello_ns())
                    if connection is not None:
                        sources[connection.sock.fileno()] = connection
                        epoll.register(connection.sock.fileno(), select.EPOLLIN)
                elif isinstance(source, Connection):
                    clock.handle(source)
                elif isinstance(source, SocketCanPort):
                    source.receive()
                else:
                    rig.power_stage.serve_sensors()
