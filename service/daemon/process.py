"""The daemon's process: brings everything up in order, serves until a signal, takes everything down in order."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import sys
from collections.abc import Callable
from contextlib import AsyncExitStack

from config import Installation
from config.paths import run_directory, state_directory
from driver.arm import ArmLoop
from service.cli.console import say
from service.daemon.commands import commands_of
from service.daemon.lock import ArmLock
from service.daemon.protocol import control_socket, look_socket
from service.daemon.server import Server
from service.daemon.systemd import notify
from service.daemon.watchdog import watch, watch_recorder
from service.outcomes import ArmStopped
from service.sessions.conductor import Conductor
from service.sessions.moving import MovingArm
from service.sessions.standing_recorder import StandingRecorder
from service.sessions.store import SessionStore

log = logging.getLogger(__name__)


def run_daemon(installation: Installation, *, lockstep: bool, ready: Callable[[], None]) -> None:
    """Serve the installation's arm until SIGTERM or SIGINT. ``ready`` is called once, when clients are served.

    Raises InputError with one sentence when the arm cannot be served, ArmStopped when the cyclic loop ends by itself;
    nothing is left running then.
    """
    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="%(levelname)s %(name)s: %(message)s")
    lock = ArmLock(run_directory(), installation.arm.name)
    try:
        asyncio.run(_serve(installation, lockstep, ready))
    finally:
        lock.release()


async def _serve(installation: Installation, lockstep: bool, ready: Callable[[], None]) -> None:
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
        loop = await asyncio.to_thread(ArmLoop.start, installation, lockstep=lockstep, ring_name=ring, progress=_tell)
        stack.push_async_callback(asyncio.to_thread, loop.close)
        recorder = await asyncio.to_thread(StandingRecorder, installation, ring, store.directory)
        stack.push_async_callback(asyncio.to_thread, recorder.close)
        moving = MovingArm(installation, loop, recorder, ring, store.directory)
        stack.push_async_callback(asyncio.to_thread, moving.close)
        conductor = Conductor(moving, store)
        server = Server(commands_of(conductor), control_socket(run_directory(), arm), look_socket(run_directory(), arm))
        await server.start()
        stack.push_async_callback(server.close)
        # First of all, while clients are still connected: the session's end is their answer.
        stack.push_async_callback(conductor.end, "the daemon was asked to end")
        ready()
        if not notify("READY=1", f"STATUS=serving {arm}"):
            say(f"etude daemon: serving {arm} at {control_socket(run_directory(), arm)}")
        asked = asyncio.create_task(ending.wait())
        watching = asyncio.create_task(watch(loop, lockstep=lockstep))
        reviving = asyncio.create_task(watch_recorder(recorder))
        await asyncio.wait({asked, watching}, return_when=asyncio.FIRST_COMPLETED)
        notify("STOPPING=1", "STATUS=stopping the arm")
        asked.cancel()
        reviving.cancel()
        if watching.done():
            raise ArmStopped(watching.result())
        watching.cancel()


def _tell(text: str) -> None:
    notify(f"STATUS={text}")
