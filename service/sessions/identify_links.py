"""A session that identifies the links: plays the motions that excite them, records each, estimates."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict

from config import Installation
from config.schema import Mode
from service.identification.request import EstimatorName, LinksRequest
from service.identification.worker import in_worker
from service.sessions.moving import MovingArm, SessionController, plan_motion
from service.sessions.playing import planned, play_recorded
from service.sessions.procedure import Tell, part
from service.sessions.store import Kind, Session

PLAYING_SHARE = 0.85
"""Share of the session that goes by in motion; the rest is estimation."""


class IdentifyLinksArguments(BaseModel):
    model_config = ConfigDict(extra="forbid")

    motions: tuple[str, ...] = ()
    """By name or file; the installation's ``identification_motions`` when empty."""
    hold_out_motions: tuple[str, ...] = ()
    mode: Mode = "csp"
    controller: SessionController = "pd"
    estimator: EstimatorName = "optimal_filter"
    band_hz: float | None = None


class IdentifyLinks:
    """Play, record, estimate; all motions are checked against the limits before the first one moves."""

    kind: Kind = "identify-links"

    def __init__(self, installation: Installation, arguments: IdentifyLinksArguments) -> None:
        self._asked = arguments
        self._installation = installation
        mode, controller = arguments.mode, arguments.controller
        self._learning = planned(arguments.motions, "identification_motions", installation, mode, controller)
        self._held_out = [plan_motion(name, installation, mode, controller) for name in arguments.hold_out_motions]

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        plans = [*self._learning, *self._held_out]
        paths = await play_recorded(moving, session, plans, part(tell, 0.0, PLAYING_SHARE))
        tell("estimating", PLAYING_SHARE)
        count = len(self._learning)
        request = LinksRequest(
            recordings=tuple(paths[:count]),
            hold_out=tuple(paths[count:]),
            directory=session.directory,
            arm=str(self._installation.path),
            estimator=self._asked.estimator,
            band_hz=self._asked.band_hz,
        )
        answer = await in_worker(request, part(tell, PLAYING_SHARE, 1.0))
        return {"session": session.id, "recordings": [str(p) for p in paths], **answer}
