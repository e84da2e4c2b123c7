"""A session that identifies the links: plays the motions that excite them, records each, estimates."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict

from config import InputError, Installation
from config.schema import Mode
from driver.plan import Plan
from service.identification.request import EstimatorName, LinksRequest
from service.identification.worker import in_worker
from service.sessions.moving import MovingArm, SessionController, plan_motion
from service.sessions.procedure import Tell
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
        motions = arguments.motions or installation.arm.identification_motions
        if not motions:
            raise InputError(
                str(installation.path),
                f"arm {installation.arm.name} lists no identification_motions",
                "list some under [arm], or name motions, or give recordings",
            )
        self._learning = [self._plan(name) for name in motions]
        self._held_out = [self._plan(name) for name in arguments.hold_out_motions]

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        tell("enabling the drives", 0.0)
        await moving.enable(self._asked.mode)
        plans = [*self._learning, *self._held_out]
        paths: list[Path] = []
        for k, plan in enumerate(plans):
            path = await self._record(moving, session, plan, _part(tell, k, len(plans)))
            paths.append(path)
        await moving.disable()
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
        answer = await in_worker(
            request, lambda stage, share: tell(stage, PLAYING_SHARE + (1.0 - PLAYING_SHARE) * share)
        )
        return {"session": session.id, "recordings": [str(p) for p in paths], **answer}

    async def _record(self, moving: MovingArm, session: Session, plan: Plan, tell: Tell) -> Path:
        await moving.go_to(plan.q[0], plan.mode, lambda share: tell("moving to the next start", 0.5 * share))
        metadata = {"motion": plan.name, "mode": plan.mode, "controller": plan.controller}
        return await moving.play_recorded(
            plan, session, metadata, lambda share: tell(f"playing {plan.name}", 0.5 + 0.5 * share)
        )

    def _plan(self, name: str) -> Plan:
        return plan_motion(name, self._installation, self._asked.mode, self._asked.controller)


def _part(tell: Tell, k: int, count: int) -> Tell:
    """Progress of the k-th of ``count`` motions as progress of the session."""
    return lambda stage, share: tell(stage, PLAYING_SHARE * (k + share) / count)
