"""A session that calibrates the torque constants: the same rests and motions without a load, then with one.

Twice asked, because a person hangs the load in between: the first time the arm plays free and keeps the recordings,
the second time it plays the same with the load, which the wrist sensor weighs and whose lever the geometry knows.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from config import InputError, Installation
from config.schema import Mode
from service.identification.request import TorqueConstantRequest
from service.identification.worker import in_worker
from service.sessions.identify_load import PLAYING_SHARE
from service.sessions.moving import MovingArm, SessionController
from service.sessions.playing import planned, play_recorded
from service.sessions.procedure import Tell, part
from service.sessions.store import Kind, Session


class CalibrateTorqueConstantArguments(BaseModel):
    model_config = ConfigDict(extra="forbid")

    without: tuple[Path, ...] = ()
    """Recordings of the arm without the load; none: these are what the session makes."""
    motions: tuple[str, ...] = ()
    """By name or file; the installation's ``load_identification_motions`` when empty."""
    band_hz: float | None = None
    mode: Mode = "csp"
    controller: SessionController = "pd"


class CalibrateTorqueConstant:
    """Play, record, and with the load on: compare; all motions are checked before the first one moves."""

    kind: Kind = "calibrate-torque-constant"

    def __init__(self, installation: Installation, arguments: CalibrateTorqueConstantArguments) -> None:
        self._asked = arguments
        self._installation = installation
        if not installation.wrench_sensor:
            raise InputError(
                str(installation.path),
                f"arm {installation.arm.name} has no wrench sensor, which the torques are compared with",
                "give recordings that hold a wrench",
            )
        for path in arguments.without:
            if not path.exists():
                raise InputError(str(path), "no such recording", "name what the session without the load recorded")
        mode, controller = arguments.mode, arguments.controller
        self._plans = planned(arguments.motions, "load_identification_motions", installation, mode, controller)

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        paths = await play_recorded(moving, session, self._plans, part(tell, 0.0, PLAYING_SHARE))
        played = {"session": session.id, "recordings": [str(path) for path in paths]}
        if not self._asked.without:
            status = "recorded without the load"
            nothing: dict[str, Any] = {"joints": None, "load": None, "notes": [], "warnings": []}
            return {**played, "arm": self._installation.arm.name, "status": status, **nothing}
        tell("estimating", PLAYING_SHARE)
        request = TorqueConstantRequest(
            recordings=tuple(paths),
            directory=session.directory,
            without=self._asked.without,
            arm=str(self._installation.path),
            band_hz=self._asked.band_hz,
        )
        return {**played, **await in_worker(request, part(tell, PLAYING_SHARE, 1.0))}
