"""A session that diagnoses the arm: plays motions twice each, judges, plays the motion that decides, or reads the
drives while they are off where that decides, and judges again; at last it may measure what the found model gains."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from config import InputError, Installation
from config.schema import Mode
from service.diagnosis.keeping import keep_answer
from service.diagnosis.request import DiagnoseRequest
from service.identification.worker import in_worker
from service.sessions.following import Following
from service.sessions.moving import MovingArm, SessionController, plan_motion
from service.sessions.playing import planned, play_recorded
from service.sessions.procedure import Tell, part
from service.sessions.store import Kind, Session

PLAYINGS = 2
"""Of every motion to begin with: what differs between them is noise."""
PLAYING_SHARE = 0.6
"""Share of a round that goes by in motion; the rest is judging."""


LAST_SHARE = 0.2
"""Share of a session that goes by while the arm follows a motion under both models."""


class DiagnoseArguments(BaseModel):
    model_config = ConfigDict(extra="forbid")

    recordings: tuple[Path, ...] = ()
    """To begin with; without any the arm plays ``motions``."""
    hold_out: tuple[Path, ...] = ()
    drives_off: tuple[Path, ...] = ()
    """Recordings at rest with the drives off."""
    motions: tuple[str, ...] = ()
    """By name or file; the installation's ``identification_motions`` when empty."""
    budget: int = Field(default=2, ge=0, le=20)
    """Deciding motions that there may be; where it is above zero, a reading of the drives while they are off may come
    besides, once."""
    tolerance: float = 0.05
    track: str | None = None
    """A motion, by name or file, that is played at the end under both models' feedforward."""
    mode: Mode = "csp"
    controller: SessionController = "pd"


class DiagnoseArm:
    """Goes on until every cause is decided, nothing decides further, or the budget is spent.

    All motions that are known beforehand are checked against the limits before the first one moves; a designed one is
    checked before it is played.
    """

    kind: Kind = "diagnose"

    def __init__(self, installation: Installation, arguments: DiagnoseArguments) -> None:
        self._installation = installation
        self._asked = arguments
        if arguments.recordings and arguments.motions:
            raise InputError("--motion", "is for diagnosing without recordings", "leave it out, or the recordings")
        mode, controller = arguments.mode, arguments.controller
        self._plans = (
            []
            if arguments.recordings
            else planned(arguments.motions, "identification_motions", installation, mode, controller)
        )
        self._following = None if arguments.track is None else Following(arguments.track, installation, mode)

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        whole = 1.0 if self._following is None else 1.0 - LAST_SHARE
        rounds = self._asked.budget + 2 if self._asked.budget else 1
        round_share = whole / rounds
        first = part(tell, 0.0, round_share)
        recordings = list(self._asked.recordings)
        # Every motion once, then all again: friction that warms up does not look like noise.
        recordings += await play_recorded(moving, session, self._plans * PLAYINGS, part(first, 0.0, PLAYING_SHARE))
        drives_off = list(self._asked.drives_off)
        experiments: list[Mapping[str, Any]] = []
        answer = await self._judged(session, recordings, drives_off, experiments, first)
        while (designed := undecided(answer, self._asked.budget, experiments)) is not None:
            begin = (len(experiments) + 1) * round_share
            another = part(tell, begin, begin + round_share)
            if designed["motion"] is None:
                another("reading the drives while they are off", 0.0)
                drives_off.append(await moving.record_off(session, float(designed["drives_off_s"])))
            else:
                plan = plan_motion(designed["motion"], self._installation, self._asked.mode, self._asked.controller)
                plans = [plan] * int(designed["playings"])
                recordings += await play_recorded(moving, session, plans, part(another, 0.0, PLAYING_SHARE))
            played = {key: designed[key] for key in ("motion", "drives_off_s", "between", "predicted_gap")}
            experiments = [*answer["experiments"], played]
            answer = await self._judged(session, recordings, drives_off, experiments, another)
        if self._following is not None:
            answer = await self._followed(answer, self._following, moving, session, part(tell, 1.0 - LAST_SHARE, 1.0))
        return {"session": session.id, **answer}

    async def _followed(
        self, answer: dict[str, Any], following: Following, moving: MovingArm, session: Session, tell: Tell
    ) -> dict[str, Any]:
        """The answer with what the arm gains, in its files too."""
        try:
            if answer["model"] is None:
                raise InputError(
                    str(self._asked.track), "is not played", "nothing was found that feedforward could use"
                )
            tracking = await following.measured(answer["model"], moving, session, tell)
        except InputError as problem:
            # What was found stays, whatever its feedforward may ask of the arm.
            return {**answer, "notes": [*answer["notes"], str(problem)]}
        answer = {**answer, "gain": {**answer["gain"], "tracking": tracking}}
        await asyncio.to_thread(keep_answer, Path(answer["model"]).parent, answer)
        return answer

    async def _judged(
        self,
        session: Session,
        recordings: list[Path],
        drives_off: list[Path],
        experiments: list[Mapping[str, Any]],
        tell: Tell,
    ) -> dict[str, Any]:
        request = DiagnoseRequest(
            recordings=tuple(recordings),
            hold_out=self._asked.hold_out,
            drives_off=tuple(drives_off),
            arm=str(self._installation.path),
            tolerance=self._asked.tolerance,
            directory=session.directory / f"diagnosis-{len(experiments) + 1}",
            experiments=tuple(experiments),
        )
        return await in_worker(request, part(tell, PLAYING_SHARE, 1.0))


def undecided(
    answer: Mapping[str, Any], budget: int, experiments: Sequence[Mapping[str, Any]]
) -> Mapping[str, Any] | None:
    """The designed motion, or reading, of the ambiguous finding that it promises most for, of those that there may be
    yet."""
    moved = sum(one["motion"] is not None for one in experiments)
    may = {"move": moved < budget, "read": budget > 0 and moved == len(experiments)}
    designed = [
        one
        for finding in answer["findings"]
        if (one := finding["next_experiment"]) is not None
        and one["predicted_gap"] is not None
        and may["read" if one["motion"] is None else "move"]
    ]
    return max(designed, key=lambda one: float(one["predicted_gap"]), default=None)
