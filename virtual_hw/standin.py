"""The stand-in arm as a process: opens the buses and serial lines of an installation and serves them."""

from __future__ import annotations

import contextlib
import ctypes
import gc
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from config import InputError, Installation
from config.paths import run_directory
from virtual_hw.bus.local import LocalPort
from virtual_hw.bus.socketcan import SocketCanPort
from virtual_hw.event_loop import serve
from virtual_hw.faults import FaultScript, Injector
from virtual_hw.faults.fault import Stage
from virtual_hw.hidden import load_hidden
from virtual_hw.lockstep import START_NS
from virtual_hw.plant import build_plant
from virtual_hw.rig import Rig
from virtual_hw.wrench import build_sensors

_PR_SET_TIMERSLACK = 29
_PRIORITY = 40


def run_standin(
    installation: Installation,
    hidden_path: Path | str | None,
    lockstep: bool,
    seed: int,
    ready: Callable[[], None],
    run_dir: Path | None = None,
    faults: FaultScript | None = None,
) -> None:
    """Serve the installation's buses and serial lines until SIGTERM or SIGINT.

    Args:
        installation: its `bus` channels are bound here; all of kind `local` in lockstep.
        hidden_path: the hidden mechanics, a name or a file; None takes the installation's own.
        lockstep: time moves by the host's ticks alone; else it is real time.
        seed: of every random draw; in lockstep the same seed gives the same bytes.
        ready: called once, when every bus and line can be opened by a host.
        run_dir: where relative channel paths start; the run directory when absent.
        faults: what goes wrong, and when; each is told on standard error as it begins and ends.

    Raises:
        InputError: a channel cannot be had (another stand-in runs, no such interface, no permission), or the hidden
            mechanics, EDS or URDF cannot be used.
    """
    directory = run_dir or run_directory()
    hidden = load_hidden(installation, hidden_path)
    plant = build_plant(installation, hidden, seed)
    with contextlib.ExitStack() as cleanup:
        wake = cleanup.enter_context(_signals())
        rig = Rig(installation, plant, START_NS if lockstep else 0)
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
        # After the buses: a stand-in that is refused there must not take a running one's serial lines away.
        sensors = build_sensors(installation, hidden, plant, seed, directory)
        for sensor in sensors:
            cleanup.callback(sensor.close)
        rig.power_stage.connect(sensors)
        if faults is not None:
            Injector(faults, Stage(installation, rig, ports, sensors), lambda said: print(said, file=sys.stderr))
        _quieten(lockstep=lockstep)
        ready()
        serve(rig, ports, sensors, wake, lockstep=lockstep)


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


def _quieten(*, lockstep: bool) -> None:
    """No timer slack, and nothing of the start left for the collector to walk through: a millisecond is long.

    In wall clock also a fixed priority where permitted, below the host's: hardware does not wait for its turn.
    """
    if not lockstep:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_PRIORITY))
    gc.collect()
    gc.freeze()
    ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0)
