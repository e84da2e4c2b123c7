"""Feeds the service manager's watchdog, and notices when the cyclic loop or the recorder has died."""

from __future__ import annotations

import asyncio
from typing import Protocol

from config import InputError
from driver.cyclic.status import LoopStatus
from service.daemon.systemd import notify, watchdog_interval_s
from service.sessions.standing_recorder import StandingRecorder

LONGEST_PERIOD_S = 2.0
RECORDER_PERIOD_S = 1.0


class Loop(Protocol):
    """What is watched: `driver.arm.ArmLoop`."""

    @property
    def alive(self) -> bool: ...

    def status(self) -> LoopStatus: ...


async def watch(loop: Loop, *, lockstep: bool) -> str:
    """Give the manager a sign of life after new good cycles only; returns, with the reason, when the loop has ended.

    In lockstep virtual time stands while nothing moves, so there an answering loop is life enough.
    """
    interval = watchdog_interval_s()
    period = min(interval / 3 if interval else LONGEST_PERIOD_S, LONGEST_PERIOD_S)
    seen = -1
    while True:
        await asyncio.sleep(period)
        try:
            status = await asyncio.to_thread(loop.status)
        except InputError as error:
            if not loop.alive:
                return str(error)
            continue  # it lives and does not answer: the manager will hear nothing and decide
        if lockstep or status.good_cycles > seen:
            seen = status.good_cycles
            notify("WATCHDOG=1", f"STATUS={status.state.name.lower()}, {status.cycles} cycles, {status.missed} missed")


async def watch_recorder(recorder: StandingRecorder) -> None:
    """Have a fresh recorder take the place of one that died, for as long as the daemon lives."""
    while True:
        await asyncio.sleep(RECORDER_PERIOD_S)
        await asyncio.to_thread(recorder.revive_in_time)
