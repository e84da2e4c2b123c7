"""The arm as a session sees it: awaitable moves, each watched to its end, and recordings around them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.motion import check_motion, load_motion, point_to_point, sample
from config.schema import Mode
from driver.arm import ArmLoop
from driver.plan import Plan
from service.identification.recorded import DRIVES_OFF
from service.outcomes import ArmStopped
from service.sessions.live_load import LiveLoadProcess, last_identified
from service.sessions.standing_recorder import StandingRecorder
from service.sessions.store import Session

log = logging.getLogger(__name__)
Array = NDArray[np.float64]
SessionController = Literal["pd", "computed_torque"]
"""Controllers that need nothing but the installation."""
POLL_S = 0.05
AT_REST_BEFORE_S = 0.2
AT_REST_AFTER_S = 0.5
"""Loop time recorded around a motion: what the noise is measured on, and what settles after it."""
ALREADY_THERE_RAD = 1e-3
FOLLOWED_WITHIN_S = 20.0


class MovingArm:
    """Moves the arm and records it for one session at a time. Blocking calls of the driver run in threads."""

    def __init__(
        self, installation: Installation, loop: ArmLoop, recorder: StandingRecorder, ring_name: str, sessions: Path
    ) -> None:
        self.installation = installation
        self.loop = loop
        self.recorder = recorder
        self._ring_name = ring_name
        self._sessions = sessions
        self._live_load: LiveLoadProcess | None = None

    async def enable(self, mode: Mode, known_loads: Sequence[Path] = ()) -> None:
        """Enable all drives; the arm holds where it is. ``known_loads``: files of what the wrist may carry, beside the
        load that was identified last. What could not be recorded is not begun: raises InputError when the recorder is
        gone and no fresh one can be had."""
        await asyncio.to_thread(self.recorder.revive)
        await asyncio.to_thread(self.loop.enable, mode)
        await asyncio.to_thread(self._follow_the_load, known_loads)

    @property
    def load_now(self) -> dict[str, Any] | None:
        """What the wrist carries, as far as the motion since the last enabling has told: see `LiveLoadProcess`."""
        return None if self._live_load is None else self._live_load.latest()

    async def silent_sensors(self) -> dict[str, str]:
        """Wrench sensors that tell nothing at the moment, and why."""
        status = await asyncio.to_thread(self.loop.status)
        return {sensor.name: sensor.condition for sensor in status.sensors if sensor.stale}

    async def load_followed(self) -> None:
        """Wait until the load is being followed, where there is a wrist sensor; for a while at most."""
        if self._live_load is not None and not await asyncio.to_thread(self._live_load.wait_ready, FOLLOWED_WITHIN_S):
            log.warning("what the wrist carries is not followed while the arm moves")

    def close(self) -> None:
        """End what follows the arm."""
        if self._live_load is not None:
            self._live_load.close()

    def _follow_the_load(self, known: Sequence[Path]) -> None:
        self.close()
        if self.installation.wrench_sensor:
            try:
                files = [*known, *last_identified(self._sessions)]
                self._live_load = LiveLoadProcess(self.installation, self._ring_name, files)
            except OSError as error:
                self._live_load = None
                log.warning("what the wrist carries is not followed: no process could be started (%s)", error.strerror)

    async def disable(self) -> None:
        await asyncio.to_thread(self.loop.disable)

    async def stop(self, cause: str) -> None:
        await asyncio.to_thread(self.loop.stop, cause)

    async def go_to(self, q: Sequence[float] | Array, mode: Mode, progress: Callable[[float], None]) -> None:
        """Move from where the arm holds to ``q`` [rad] and wait. Raises ArmStopped when it does not arrive."""
        goal = np.asarray(q, dtype=float)
        # From the commanded position: gravity takes the measured one a little off it.
        held = np.array((await asyncio.to_thread(self.loop.status)).q_d)
        if np.max(np.abs(goal - held)) < ALREADY_THERE_RAD:
            return
        motion = point_to_point(held, goal, self.installation)
        plan = Plan(motion.q, motion.dq, motion.ddq, mode=mode, controller="pd", name="to the start")
        await self._play(plan, progress)

    async def play_recorded(
        self, plan: Plan, session: Session, metadata: dict[str, str], progress: Callable[[float], None]
    ) -> Path:
        """Play ``plan`` from where the arm holds and return its recording, which the session lists from its beginning.

        The recording is closed and kept however the run ends. Raises ArmStopped when the arm stopped meanwhile.
        """
        path = await asyncio.to_thread(self.recorder.start_run, plan.name, session.directory, metadata)
        session.update(recordings=(*session.record.recordings, path.name))
        try:
            await asyncio.to_thread(self.loop.run_for, AT_REST_BEFORE_S)
            await self._play(plan, progress)
            await asyncio.to_thread(self.loop.run_for, AT_REST_AFTER_S)
        except BaseException:
            try:
                await asyncio.to_thread(self.recorder.stop_run)
            except InputError as problem:
                # Why the motion ended is the answer; what there is of the file is kept.
                log.error("%s", problem)
            raise
        await asyncio.to_thread(self.recorder.stop_run)
        return path

    async def record_off(self, session: Session, seconds: float) -> Path:
        """The recording of that much of the loop's time with the drives off, which the session lists."""
        await asyncio.to_thread(self.recorder.revive)
        mode = (await asyncio.to_thread(self.loop.status)).mode
        metadata = {**DRIVES_OFF, **({} if mode is None else {"mode": mode})}
        path = await asyncio.to_thread(self.recorder.start_run, "drives-off", session.directory, metadata)
        session.update(recordings=(*session.record.recordings, path.name))
        try:
            await asyncio.to_thread(self.loop.run_for, seconds)
        finally:
            await asyncio.to_thread(self.recorder.stop_run)
        return path

    async def _play(self, plan: Plan, progress: Callable[[float], None]) -> None:
        run = await asyncio.to_thread(self.loop.play, plan)
        while True:
            status = await asyncio.to_thread(self.loop.status)
            if status.last_run != run:
                raise ArmStopped(f"run {run} was replaced by run {status.last_run} before it ended")
            if status.run_outcome == "done":
                progress(1.0)
                return
            if status.run_outcome is not None:
                raise ArmStopped(status.run_outcome)
            progress(status.progress)
            await asyncio.sleep(POLL_S)


def plan_motion(name: str, installation: Installation, mode: Mode, controller: SessionController) -> Plan:
    """The motion of that name or file as what the loop plays, checked as a whole against the limits.

    Raises InputError when there is no such motion, it leaves a limit, or mode and controller do not go together.
    """
    if mode == "csp" and controller != "pd":
        raise InputError("--controller", f"{controller} is a controller of torque mode", "add --mode cst")
    motion = load_motion(name, installation)
    sampled = sample(motion, installation.cycle.rate_hz)
    check_motion(sampled, installation, motion.name)
    plan = Plan(sampled.q, sampled.dq, sampled.ddq, mode=mode, controller=controller, name=motion.name)
    plan.check(installation)
    return plan


def plan_rest(installation: Installation, seconds: float, mode: Mode, controller: SessionController, name: str) -> Plan:
    """Rest at home for that long, to be recorded."""
    home = np.tile(installation.arm.home_rad, (max(2, round(seconds * installation.cycle.rate_hz)), 1))
    still = np.zeros_like(home)
    return Plan(home, still, still, mode=mode, controller=controller, name=name)
