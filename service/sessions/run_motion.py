"""A session that plays one motion and records it."""

from __future__ import annotations

import asyncio
from typing import Any

from pydantic import BaseModel, ConfigDict

from config import InputError, Installation
from config.schema import Mode
from driver.recording import read_recording
from service.practice.feedforward import plan_with_feedforward
from service.practice.planning import command_delay
from service.sessions.moving import MovingArm, SessionController, plan_motion
from service.sessions.procedure import Tell
from service.sessions.store import Kind, Session
from service.sessions.tracking import tracking_errors


class RunArguments(BaseModel):
    model_config = ConfigDict(extra="forbid")

    motion: str
    mode: Mode = "csp"
    controller: SessionController = "pd"
    feedforward: str | None = None
    """See `service.practice.feedforward.plan_with_feedforward`."""


class RunMotion:
    """Move to the motion's start, play it, record it; the answer tells how well the arm followed."""

    kind: Kind = "run"

    def __init__(self, installation: Installation, arguments: RunArguments) -> None:
        self._asked = arguments
        if arguments.feedforward is None:
            self._plan = plan_motion(arguments.motion, installation, arguments.mode, arguments.controller)
        else:
            if arguments.controller != "pd":
                raise InputError("--feedforward", f"goes with pd, not with {arguments.controller}", "leave one out")
            self._plan = plan_with_feedforward(arguments.motion, installation, arguments.mode, arguments.feedforward)

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump()

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        plan = self._plan
        tell("enabling the drives", 0.0)
        await moving.enable(plan.mode)
        await moving.go_to(plan.q[0], plan.mode, lambda share: tell("moving to the start", 0.05 + 0.3 * share))
        path = await moving.play_recorded(
            plan,
            session,
            {"motion": plan.name, "mode": plan.mode, "controller": plan.controller},
            lambda share: tell(f"playing {plan.name}", 0.35 + 0.6 * share),
        )
        recording = await asyncio.to_thread(read_recording, path)
        return {
            "session": session.id,
            "motion": plan.name,
            "recording": str(path),
            "samples": len(recording.t),
            "duration_s": float(recording.t[-1] - recording.t[0]),
            "silent_sensors": await moving.silent_sensors(),
            "tracking_error": tracking_errors(recording, command_delay(plan.mode)),
        }
