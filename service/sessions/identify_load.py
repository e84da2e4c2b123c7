"""A session that identifies the load on the wrist: rests, plays the motions that turn and swing it, records, estimates.

The sensor's offset and drift are estimated with the load: it rests at home before and after the motions, in the same
pose, so what it reads differently there is drift.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from config import InputError, Installation
from config.schema import Mode
from service.identification.load_file import read_loads, read_one_load
from service.identification.request import LoadForm, LoadRequest, Tolerance
from service.identification.worker import in_worker
from service.sessions.moving import MovingArm, SessionController, plan_rest
from service.sessions.playing import planned, play_recorded
from service.sessions.procedure import Tell, part
from service.sessions.store import Kind, Session

PLAYING_SHARE = 0.9
"""Share of the session that goes by in motion; the rest is estimation."""
REST_S = 2.0


class IdentifyLoadArguments(BaseModel):
    model_config = ConfigDict(extra="forbid")

    motions: tuple[str, ...] = ()
    """By name or file; the installation's ``load_identification_motions`` when empty."""
    tares: tuple[Path, ...] = ()
    hand: Path | None = None
    library: Path | None = None
    expect: Path | None = None
    mass_tolerance: float = Tolerance.mass_kg
    centre_tolerance: float = Tolerance.centre_m
    form: LoadForm = "differentiated"
    band_hz: float | None = None
    mode: Mode = "csp"
    controller: SessionController = "pd"


class IdentifyLoad:
    """Play, record, estimate; all motions are checked against the limits before the first one moves."""

    kind: Kind = "identify-load"

    def __init__(self, installation: Installation, arguments: IdentifyLoadArguments) -> None:
        self._asked = arguments
        self._installation = installation
        if not installation.wrench_sensor:
            raise InputError(
                str(installation.path),
                f"arm {installation.arm.name} has no wrench sensor",
                "play motions with and without the load and give the recordings: etude identify load … --without …",
            )
        played = planned(
            arguments.motions, "load_identification_motions", installation, arguments.mode, arguments.controller
        )
        before, after = (
            plan_rest(installation, REST_S, arguments.mode, arguments.controller, f"rest-{when}")
            for when in ("before", "after")
        )
        self._plans = [before, *played, after]
        # A file that holds no load is told before the arm has moved for nothing.
        if arguments.library is not None:
            read_loads(arguments.library)
        for path in (arguments.expect, arguments.hand):
            if path is not None:
                read_one_load(path)

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        known = [path for path in (self._asked.library, self._asked.expect) if path is not None]
        playing = part(tell, 0.0, PLAYING_SHARE)
        paths = await play_recorded(moving, session, self._plans, playing, follow_load=True, known_loads=known)
        live = moving.load_now
        tell("estimating", PLAYING_SHARE)
        asked = self._asked
        request = LoadRequest(
            recordings=tuple(paths),
            directory=session.directory,
            tares=asked.tares,
            hand=asked.hand,
            library=asked.library,
            expect=asked.expect,
            tolerance=Tolerance(asked.mass_tolerance, asked.centre_tolerance),
            arm=str(self._installation.path),
            form=asked.form,
            band_hz=asked.band_hz,
        )
        answer = await in_worker(request, part(tell, PLAYING_SHARE, 1.0))
        return {"session": session.id, "recordings": [str(p) for p in paths], "live": live, **answer}
