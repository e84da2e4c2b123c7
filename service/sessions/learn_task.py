"""A session that learns a task by a few parameters of its plan: replays for the scatter, then trials (7.2)."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from config import Installation
from config.schema import Mode
from driver.plan import Plan
from driver.recording import read_recording
from learner.task_level import TaskLearner
from service.practice.carrying import Carrying
from service.practice.hitting import Hitting
from service.practice.inverse_models import load_inverse_model
from service.practice.planning import Practised
from service.practice.task_file import HitTask, load_task
from service.practice.tasks import TaskOnArm, plan_of
from service.practice.trials import trial_of
from service.reports.task_plot import plot_task
from service.sessions.moving import MovingArm
from service.sessions.procedure import Tell, within
from service.sessions.store import Kind, Session

Array = NDArray[np.float64]


class LearnTaskArguments(BaseModel):
    """What `etude practise --task` is asked."""

    model_config = ConfigDict(extra="forbid")

    task: str
    """File."""
    model: str | None = None
    mode: Mode = "csp"
    trials: Annotated[int, Field(ge=1, le=100)] = 10
    replays: Annotated[int, Field(ge=5, le=50)] = 5


class LearnTask:
    """The first plan is made and checked before anything moves."""

    kind: Kind = "learn-task"

    def __init__(self, installation: Installation, arguments: LearnTaskArguments) -> None:
        self._asked = arguments
        self._task = _task_of(arguments, installation)
        plan_of(self._task, self._task.start, "first")

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        task, replays = self._task, self._asked.replays
        plays = replays + self._asked.trials
        tell("enabling the drives", 0.0)
        await moving.enable(self._asked.mode)
        first = [
            await self._outcome(moving, session, tell, f"replay-{k + 1:02d}", task.start, k / plays, plays)
            for k in range(replays)
        ]
        scatter = np.maximum(np.std(first, axis=0, ddof=1), task.resolution)
        learner = TaskLearner(task.predict, task.start, task.wanted, scatter, task.reach)
        outcome = np.mean(first, axis=0)
        played = [_played(task, task.start, outcome)]
        done = learner.take(outcome)
        while not done and len(played) <= self._asked.trials:
            k = len(played)
            parameters = learner.parameters.copy()
            begin = (replays + k - 1) / plays
            outcome = await self._outcome(moving, session, tell, f"trial-{k:02d}", parameters, begin, plays)
            played.append(_played(task, parameters, outcome))
            done = learner.take(outcome)
        await moving.disable()
        stopped = "the miss cannot be told from chance" if done else "all trials were played"
        answer = {
            "session": session.id,
            "task": task.name,
            "kind": "hit" if isinstance(task, Hitting) else "carry",
            "arm": moving.installation.arm.name,
            "mode": self._asked.mode,
            "model": task.model.source,
            "replays": replays,
            "wanted": _by_name(task.outcomes.names, task.wanted),
            "units": dict(zip(task.outcomes.names, task.outcomes.units, strict=True)),
            "scatter": _by_name(task.outcomes.names, scatter),
            "trials": played,
            "stopped_because": stopped,
            "recordings": [str(session.directory / name) for name in session.record.recordings],
        }
        plot = session.directory / "task.png"
        await asyncio.to_thread(plot_task, plot, answer)
        return {**answer, "plot": str(plot)}

    async def _outcome(
        self, moving: MovingArm, session: Session, tell: Tell, name: str, parameters: Array, begin: float, plays: int
    ) -> Array:
        """Play the plan of these parameters from its start and judge what came of it."""
        practised, plan = await asyncio.to_thread(plan_of, self._task, parameters, name)
        progress = within(tell, name.replace("-", " "), begin, begin + 1.0 / plays)
        path = await self._play(moving, session, plan, name, progress)
        return await asyncio.to_thread(self._judged, path, practised, parameters)

    async def _play(self, moving: MovingArm, session: Session, plan: Plan, name: str, tell: Any) -> Path:
        await moving.go_to(plan.q[0], plan.mode, lambda share: tell(0.5 * share))
        metadata = {"task": self._task.name, "mode": plan.mode, "practice": name}
        return await moving.play_recorded(plan, session, metadata, lambda share: tell(0.5 + 0.5 * share))

    def _judged(self, path: Path, practised: Practised, parameters: Array) -> Array:
        trial = trial_of(read_recording(path), practised.reference, practised.command_delay, str(path))
        return self._task.outcome(trial, parameters)


def _task_of(asked: LearnTaskArguments, installation: Installation) -> TaskOnArm:
    file = load_task(asked.task, installation)
    model = load_inverse_model(asked.model, installation)
    name = Path(asked.task).stem
    if isinstance(file, HitTask):
        return Hitting(name, file, installation, asked.mode, model)
    beside = Path(asked.task).parent / file.motion
    motion = str(beside) if file.motion.endswith(".toml") else file.motion
    return Carrying(name, motion, installation, asked.mode, model)


def _played(task: TaskOnArm, parameters: Array, outcome: Array) -> dict[str, Any]:
    return {
        "parameters": _by_name(task.parameters.names, parameters),
        "outcome": _by_name(task.outcomes.names, outcome),
        "miss": _by_name(task.outcomes.names, outcome - task.wanted),
    }


def _by_name(names: tuple[str, ...], values: Array) -> dict[str, float]:
    return {name: float(x) for name, x in zip(names, values, strict=True)}
