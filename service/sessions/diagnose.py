"""A session that diagnoses the arm: plays motions twice each, judges, plays the motion that decides, judges again."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from config import InputError, Installation
from config.schema import Mode
from driver.plan import Plan
from service.diagnosis.request import DiagnoseRequest
from service.identification.worker import in_worker
from service.sessions.moving import MovingArm, SessionController, plan_motion
from service.sessions.procedure import Tell, within
from service.sessions.store import Kind, Session

PLAYINGS = 2
"""Of every motion: what differs between them is noise."""


class DiagnoseArguments(BaseModel):
    model_config = ConfigDict(extra="forbid")

    recordings: tuple[Path, ...] = ()
    """To begin with; without any the arm plays ``motions``."""
    hold_out: tuple[Path, ...] = ()
    motions: tuple[str, ...] = ()
    """By name or file; the installation's ``identification_motions`` when empty."""
    budget: int = Field(default=2, ge=0, le=20)
    """Deciding motions that may be played."""
    tolerance: float = 0.05
    mode: Mode = "csp"
    controller: SessionController = "pd"


class DiagnoseArm:
    """Goes on until every cause is decided, no motion decides further, or the budget is spent.

    All motions that are known beforehand are checked against the limits before the first one moves; a designed one is
    checked before it is played.
    """

    kind: Kind = "diagnose"

    def __init__(self, installation: Installation, arguments: DiagnoseArguments) -> None:
        self._installation = installation
        self._asked = arguments
        motions = () if arguments.recordings else arguments.motions or installation.arm.identification_motions
        if not motions and not arguments.recordings:
            raise InputError(
                str(installation.path),
                f"arm {installation.arm.name} lists no identification_motions",
                "list some under [arm], or name motions, or give recordings",
            )
        if arguments.recordings and arguments.motions:
            raise InputError("--motion", "is for diagnosing without recordings", "leave it out, or the recordings")
        self._plans = [self._plan(name) for name in motions]

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        rounds = self._asked.budget + 1
        recordings = list(self._asked.recordings)
        # Every motion once, then all again: friction that warms up does not look like noise.
        recordings += await self._recorded(moving, session, self._plans * PLAYINGS, _part(tell, 0, rounds))
        experiments: list[Mapping[str, Any]] = []
        answer = await self._judged(session, recordings, experiments, _part(tell, 0, rounds))
        while len(experiments) < self._asked.budget and (designed := _undecided(answer)) is not None:
            part = _part(tell, len(experiments) + 1, rounds)
            plan = self._plan(designed["motion"])
            recordings += await self._recorded(moving, session, [plan] * PLAYINGS, part)
            played = {key: designed[key] for key in ("motion", "between", "predicted_gap")}
            experiments = [*answer["experiments"], played]
            answer = await self._judged(session, recordings, experiments, part)
        return {"session": session.id, **answer}

    async def _recorded(self, moving: MovingArm, session: Session, plans: list[Plan], tell: Tell) -> list[Path]:
        """Recordings of these motions; the drives rest before and after."""
        if not plans:
            return []
        tell("enabling the drives", 0.0)
        await moving.enable(self._asked.mode)
        paths = []
        for k, plan in enumerate(plans):
            begin, end = 0.6 * k / len(plans), 0.6 * (k + 1) / len(plans)
            await moving.go_to(plan.q[0], plan.mode, within(tell, "moving to the next start", begin, begin))
            metadata = {"motion": plan.name, "mode": plan.mode, "controller": plan.controller}
            playing = within(tell, f"playing {plan.name}", begin, end)
            paths.append(await moving.play_recorded(plan, session, metadata, playing))
        await moving.disable()
        return paths

    async def _judged(
        self, session: Session, recordings: list[Path], experiments: list[Mapping[str, Any]], tell: Tell
    ) -> dict[str, Any]:
        request = DiagnoseRequest(
            recordings=tuple(recordings),
            hold_out=self._asked.hold_out,
            arm=str(self._installation.path),
            tolerance=self._asked.tolerance,
            directory=session.directory / f"diagnosis-{len(experiments) + 1}",
            experiments=tuple(experiments),
        )
        return await in_worker(request, lambda stage, share: tell(stage, 0.6 + 0.4 * share))

    def _plan(self, name: str) -> Plan:
        return plan_motion(name, self._installation, self._asked.mode, self._asked.controller)


def _undecided(answer: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The designed motion of the ambiguous finding that it promises most for."""
    designed = [
        finding["next_experiment"]
        for finding in answer["findings"]
        if finding["next_experiment"] is not None and finding["next_experiment"]["motion"] is not None
    ]
    return max(designed, key=lambda one: float(one["predicted_gap"]), default=None)


def _part(tell: Tell, k: int, rounds: int) -> Tell:
    """Progress of the k-th round as progress of the session."""
    return lambda stage, share: tell(stage, (k + share) / rounds)
