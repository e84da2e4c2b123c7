"""The stand-in arm as a process: opens the buses and serial lines of an installation and serves them."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import select
import signal
import socket
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from config import InputError, Installation
from config.paths import run_directory
from virtual_hw.bus.local import Connection, LocalPort
from virtual_hw.bus.socketcan import SocketCanPort
from virtual_hw.drive.power_stage import SerialSensor
from virtual_hw.hidden import load_hidden
from virtual_hw.lockstep import START_NS, Lockstep
from virtual_hw.plant import build_plant
from virtual_hw.rig import Rig
from virtual_hw.wall_clock import WallClock
from virtual_hw.wrench import build_sensors

_PR_SET_TIMERSLACK = 29


def run_standin(
    installation: Installation,
    hidden_path: Path | str | None,
    lockstep: bool,
    seed: int,
    ready: Callable[[], None],
    run_dir: Path | None = None,
) -> None:
    """Serve the installation's buses and serial lines until SIGTERM or SIGINT.

    Args:
        installation: its `bus` channels are bound here; all of kind `local` in lockstep.
        hidden_path: the hidden mechanics, a name or a file; None takes the installation's own.
        lockstep: time moves by the host's ticks alone; else it is real time.
        seed: of every random draw; in lockstep the same seed gives the same bytes.
        ready: called once, when every bus and line can be opened by a host.
        run_dir: where relative channel paths start; the run directory when absent.

    Raises:
        InputError: a channel cannot be had (another stand-in runs, no such interface, no permission), or the hidden
            mechanics, EDS or URDF cannot be used.
    """
    directory = run_dir or run_directory()
    hidden = load_hidden(installation, hidden_path)
    plant = build_plant(installation, hidden, seed)
    with contextlib.ExitStack() as cleanup:
        wake = cleanup.enter_context(_signals())
        sensors = build_sensors(installation, hidden, plant, seed, directory)
        for sensor in sensors:
            cleanup.callback(sensor.close)
        rig = Rig(installation, plant, sensors, START_NS if lockstep else 0)
        ports: list[LocalPort | SocketCanPort] = []
        for bus, declared in zip(rig.buses, installation.bus, strict=True):
            kind, _, where = declared.channel.partition(":")
            if kind == "local":
                ports.append(LocalPort(directory / where, bus))
            elif lockstep:
                raise InputError(declared.channel, "SocketCAN has no lockstep", "use a local: channel, or wall clock")
            else:
                ports.append(SocketCanPort(where, bus))
            cleanup.callback(ports[-1].close)
        _quieten()
        ready()
        _serve(rig, ports, sensors, wake, lockstep=lockstep)


def _serve(
    rig: Rig,
    ports: Sequence[LocalPort | SocketCanPort],
    sensors: Sequence[SerialSensor],
    wake: socket.socket,
    *,
    lockstep: bool,
) -> None:
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
                clock.advance()
                # epoll's own time-out counts milliseconds; select's on the epoll descriptor counts microseconds.
                select.select([epoll], [], [], clock.seconds_to_next_event())
                events = epoll.poll(0)
            else:
                events = epoll.poll()
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


@contextlib.contextmanager
def _signals() -> Iterator[socket.socket]:
    """A socket that becomes readable when SIGTERM or SIGINT arrives."""
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    previous = {number: signal.signal(number, lambda *_: None) for number in (signal.SIGTERM, signal.SIGINT)}
    wakeup = signal.set_wakeup_fd(sender.fileno())
    try:
        yield receiver
    finally:
        signal.set_wakeup_fd(wakeup)
        for number, handler in previous.items():
            signal.signal(number, handler)
        receiver.close()
        sender.close()


def _quieten() -> None:
    """No timer slack, and nothing of the start left for the collector to walk through: a millisecond is long."""
    gc.collect()
    gc.freeze()
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
