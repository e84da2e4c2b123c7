"""How well the arm follows a motion under the given model's feedforward, and under that of the model that was found."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from config import Installation
from config.schema import Mode
from driver.recording import read_recording
from service.practice.feedforward import plan_by_model
from service.practice.planning import command_delay
from service.sessions.moving import MovingArm
from service.sessions.playing import play_recorded
from service.sessions.procedure import Tell, part
from service.sessions.store import Session
from service.sessions.tracking import tracking_errors

PLAYINGS = 2
"""Under each model: a joint that sticks comes to its first start otherwise than to its second."""


class Following:
    """One motion of an installation, in one mode. Raises InputError when it leaves a limit under the given model."""

    def __init__(self, motion: str, installation: Installation, mode: Mode) -> None:
        self._motion, self._installation, self._mode = motion, installation, mode
        self._given = plan_by_model(motion, installation, mode, None)

    async def measured(self, model: str, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        """Plays the motion under both; the answer's ``gain.tracking``. ``model``: file of the one that was found."""
        found = await asyncio.to_thread(plan_by_model, self._motion, self._installation, self._mode, model)
        told = []
        for k, plan in enumerate((self._given, found)):
            shown = part(tell, 0.5 * k, 0.5 * (k + 1))
            told.append(await play_recorded(moving, session, [plan] * PLAYINGS, shown))
        before, after = [await asyncio.to_thread(self._off, paths) for paths in told]
        joints = self._installation.joint_names
        return {
            "motion": self._given.name,
            "position_before_rms": _mean(before),
            "position_after_rms": _mean(after),
            "joints": {
                joint: {"before_rms": b, "after_rms": a} for joint, b, a in zip(joints, before, after, strict=True)
            },
            "unit": "rad",
            "recordings": {"before": [str(path) for path in told[0]], "after": [str(path) for path in told[1]]},
        }

    def _off(self, paths: Sequence[Path]) -> list[float]:
        """rad rms of each joint, over all playings."""
        delay = command_delay(self._mode)
        errors = [tracking_errors(read_recording(path), delay) for path in paths]
        return [_mean([one[joint]["position_rms"] for one in errors]) for joint in self._installation.joint_names]


def _mean(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
