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
from driver.plan import Plan
from service.identification.request import LoadForm, LoadRequest, Tolerance
from service.identification.worker import in_worker
from service.sessions.moving import MovingArm, SessionController, plan_motion, plan_rest
from service.sessions.procedure import Tell
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
        place, name = str(installation.path), installation.arm.name
        if not installation.wrench_sensor:
            raise InputError(
                place,
                f"arm {name} has no wrench sensor",
                "play motions with and without the load and give the recordings: etude identify load … --without …",
            )
        motions = arguments.motions or installation.arm.load_identification_motions
        if not motions:
            raise InputError(
                place,
                f"arm {name} lists no load_identification_motions",
                "list some under [arm], or name motions, or give recordings",
            )
        played = [plan_motion(m, installation, arguments.mode, arguments.controller) for m in motions]
        before, after = (
            plan_rest(installation, REST_S, arguments.mode, arguments.controller, f"rest-{when}")
            for when in ("before", "after")
        )
        self._plans = [before, *played, after]

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        tell("enabling the drives", 0.0)
        await moving.enable(self._asked.mode)
        paths: list[Path] = []
        for k, plan in enumerate(self._plans):
            paths.append(await self._record(moving, session, plan, _part(tell, k, len(self._plans))))
        await moving.disable()
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


def _part(tell: Tell, k: int, count: int) -> Tell:
    """Progress of the k-th of ``count`` motions as progress of the session."""
    return lambda stage, share: tell(stage, PLAYING_SHARE * (k + share) / count)
