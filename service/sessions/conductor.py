"""Conducts sessions: one at a time has the arm, any number of clients follow it, each ending is recorded."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

from config import InputError
from driver.cyclic.cycle import LoopState
from service.outcomes import ArmStopped
from service.sessions.moving import MovingArm
from service.sessions.procedure import Procedure
from service.sessions.store import Session, SessionState, SessionStore

log = logging.getLogger(__name__)
ENABLED = (LoopState.HOLDING, LoopState.PLAYING)
ENDS_ITSELF_S = 2.0
"""For a session to notice by itself that the cyclic loop does not answer."""


class RunningSession:
    """A session at work. ``outcome`` is its answer, or the exception that ended it, once ``work`` is done."""

    def __init__(self, session: Session, moving: MovingArm) -> None:
        self.session = session
        self._moving = moving
        self.stage = ""
        self.share = 0.0
        self.work: asyncio.Task[dict[str, Any]]
        self._news = asyncio.Event()

    def tell(self, stage: str, share: float) -> None:
        if stage != self.stage:
            # Each stage is kept, its progress is only told: fsync at every percent would be a cost for nobody.
            self.session.update(stage=stage, progress=round(share, 4))
        self.stage, self.share = stage, share
        self._news.set()

    async def follow(self, progress: Callable[[dict[str, Any]], Awaitable[None]]) -> dict[str, Any]:
        """Send progress until the session ends; its answer, or its exception. Cancelling the following leaves it be."""
        self.work.add_done_callback(lambda _: self._news.set())
        await progress(self._now())
        while not self.work.done():
            await self._news.wait()
            self._news.clear()
            await progress(self._now())
        return await asyncio.shield(self.work)

    def _now(self) -> dict[str, Any]:
        load = self._moving.load_now
        return {"session": self.session.id, "stage": self.stage, "share": self.share, "load": load}


class Conductor:
    """Gives the arm to one session after another."""

    def __init__(self, moving: MovingArm, store: SessionStore) -> None:
        self.moving = moving
        self.store = store
        self.current: RunningSession | None = None
        self._ending = False

    def start(self, procedure: Procedure, *, attached: bool, uid: int) -> RunningSession:
        """Begin a session. Raises InputError when another one has the arm, or the daemon is ending."""
        if self._ending:
            raise InputError(f"arm {self.store.arm}", "its daemon is ending", "start it again")
        if self.current is not None and not self.current.work.done():
            busy = self.current
            raise InputError(
                f"arm {self.store.arm}",
                f"is busy with session {busy.session.id} ({busy.stage}, {100 * busy.share:.0f} %)",
                "wait for it, or end it with etude stop",
            )
        session = self.store.create(procedure.kind, procedure.arguments(), attached=attached, uid=uid)
        running = RunningSession(session, self.moving)
        running.work = asyncio.create_task(self._conduct(procedure, running), name=session.id)
        running.work.add_done_callback(_retrieve)
        self.current = running
        return running

    async def stop(self, cause: str) -> None:
        """Stop the arm and thereby the session that moves it."""
        await self.moving.stop(cause)

    async def cancel(self, running: RunningSession, cause: str) -> None:
        """End a session safely: the arm comes to rest, estimation is dropped. Harmless when it has ended."""
        if running.work.done():
            return
        try:
            status = await asyncio.to_thread(self.moving.loop.status)
            if status.state in (*ENABLED, LoopState.ENABLING):
                await self.moving.stop(cause)
            else:
                running.work.cancel(cause)
        except InputError as error:
            # A motion whose loop is gone ends by itself, with that as its cause; estimation has to be ended.
            await asyncio.wait([running.work], timeout=ENDS_ITSELF_S)
            running.work.cancel(str(error))
        await asyncio.wait([running.work])

    async def end(self, cause: str) -> None:
        """End the running session, if any, because the daemon ends; none begins any more."""
        self._ending = True
        if self.current is not None:
            await self.cancel(self.current, cause)

    async def _conduct(self, procedure: Procedure, running: RunningSession) -> dict[str, Any]:
        session = running.session
        latched_before = await self._latched_by()
        try:
            try:
                answer = await procedure.perform(self.moving, session, running.tell)
            finally:
                await self._relax()
            session.write_result(answer)
        except ArmStopped as error:
            await self._keep_last_frames(session)
            _end(session, "stopped", str(error))
            raise
        except asyncio.CancelledError as error:
            _end(session, "interrupted", str(error) or "cancelled")
            raise ArmStopped(str(error) or "the session was cancelled") from None
        except InputError as error:
            if not self.moving.loop.alive:
                _end(session, "stopped", str(error))
                raise ArmStopped(str(error)) from error
            cause = await self._latched_by()
            if cause is not None and cause != latched_before:
                # The arm was stopped between two motions, so that the next one was refused.
                await self._keep_last_frames(session)
                _end(session, "stopped", cause)
                raise ArmStopped(cause) from None
            _end(session, "failed", str(error))
            raise
        except Exception as error:
            _end(session, "failed", f"{type(error).__name__}: {error}")
            log.exception("session %s failed", session.id)
            raise
        _end(session, "done")
        return answer

    async def _latched_by(self) -> str | None:
        """What the arm was stopped by and not reset since; None also where the loop does not answer."""
        try:
            return (await asyncio.to_thread(self.moving.loop.status)).cause
        except InputError:
            return None

    async def _relax(self) -> None:
        """Brakes on and drives off after a session, however it ended. A stopped arm has its drives off already."""
        loop = self.moving.loop
        if not loop.alive:
            return
        try:
            state = (await asyncio.to_thread(loop.status)).state
        except InputError:
            # It lives and does not answer: whatever it is at, a stop is what it shall find first when it is back.
            state = LoopState.PLAYING
        if state is LoopState.HOLDING:
            await self.moving.disable()
        elif state in (LoopState.PLAYING, LoopState.ENABLING):
            await self.moving.stop("the session ended before its motion did")

    async def _keep_last_frames(self, session: Session) -> None:
        """Put what passed on the buses just before the stop beside the session's recordings."""
        if not self.moving.loop.alive:
            return
        try:
            status = await asyncio.to_thread(self.moving.loop.status)
            if status.last_frames:
                session.write_last_frames(status.last_frames)
        except InputError as problem:
            log.error("session %s: the last frames were not kept: %s", session.id, problem)


def _end(session: Session, state: SessionState, cause: str | None = None) -> None:
    """Record the end. On a disk that takes nothing the ending is told all the same; the next start of the daemon
    finds the session unfinished and says so."""
    try:
        session.end(state, cause)
    except InputError as problem:
        log.error("session %s ended (%s) and that could not be kept: %s", session.id, cause or state, problem)


def _retrieve(work: asyncio.Task[dict[str, Any]]) -> None:
    # Its outcome is in the session's record; a session nobody follows must not warn of an unread exception.
    if not work.cancelled():
        work.exception()
