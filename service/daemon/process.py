"""The daemon's process: brings everything up in order, serves until a signal, takes everything down in order."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
from contextlib import AsyncExitStack

from config import Installation, load_installation
from config.paths import run_directory, state_directory
from driver.arm import ArmLoop
from driver.recording import RecorderProcess
from service.cli.console import say
from service.daemon.commands import commands_of
from service.daemon.lock import ArmLock
from service.daemon.protocol import control_socket, look_socket
from service.daemon.server import Server
from service.daemon.systemd import notify, watchdog_interval_s
from service.sessions.conductor import Conductor
from service.sessions.moving import MovingArm
from service.sessions.store import SessionStore

log = logging.getLogger(__name__)


def run_daemon(config: str, *, lockstep: bool) -> None:
    """Serve the arm of the installation ``config`` until SIGTERM or SIGINT.

    Raises InputError with one sentence when the arm cannot be served; nothing is left running then.
    """
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    installation = load_installation(config)
    lock = ArmLock(run_directory(), installation.arm.name)
    try:
        asyncio.run(_serve(installation, lockstep))
    finally:
        lock.release()


async def _serve(installation: Installation, lockstep: bool) -> None:
    arm = installation.arm.name
    ending = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        asyncio.get_running_loop().add_signal_handler(number, ending.set)
    store = SessionStore(state_directory(), arm)
    for session_id in store.end_abandoned():
        log.warning("session %s was left running by an earlier daemon", session_id)
    ring = f"etude-{arm}-{os.getpid()}"
    async with AsyncExitStack() as stack:
        notify("STATUS=commissioning the drives")
        loop = await asyncio.to_thread(
            ArmLoop.start, installation, lockstep=lockstep, ring_name=ring, progress=lambda text: _tell(text)
        )
        stack.push_async_callback(asyncio.to_thread, loop.close)
        recorder = await asyncio.to_thread(RecorderProcess.start, installation, ring, store.directory)
        stack.push_async_callback(asyncio.to_thread, recorder.close)
        conductor = Conductor(MovingArm(installation, loop, recorder), store)
        server = Server(commands_of(conductor), control_socket(run_directory(), arm), look_socket(run_directory(), arm))
        await server.start()
        stack.push_async_callback(server.close)
        # First of all, while clients are still connected: the session's end is their answer.
        stack.push_async_callback(conductor.end, "the daemon was asked to end")
        watching = asyncio.create_task(_feed_watchdog(loop, lockstep, ending))
        if not notify("READY=1", f"STATUS=serving {arm}"):
            say(f"etude daemon: serving {arm} at {control_socket(run_directory(), arm)}")
        await ending.wait()
        notify("STOPPING=1", "STATUS=stopping the arm")
        watching.cancel()


def _tell(text: str) -> None:
    notify(f"STATUS={text}")


async def _feed_watchdog(loop: ArmLoop, lockstep: bool, ending: asyncio.Event) -> None:
    """A sign of life to the manager only after new good cycles; the end of the loop ends the daemon.

    In lockstep virtual time stands while nothing moves, so there an answering loop is life enough.
    """
    interval = watchdog_interval_s()
    period = min(interval / 3 if interval else 2.0, 2.0)
    seen = -1
    while True:
        await asyncio.sleep(period)
        if not loop.alive:
            log.error("the cyclic loop has ended; so does the daemon")
            ending.set()
            return
        status = await asyncio.to_thread(loop.status)
        if lockstep or status.good_cycles > seen:
            seen = status.good_cycles
            notify("WATCHDOG=1", f"STATUS={status.state.name.lower()}, {status.cycles} cycles, {status.missed} missed")
