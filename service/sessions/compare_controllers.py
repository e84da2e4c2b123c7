"""A session that plays one motion under every controller of Appendix A and compares their tracking errors."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from config import Installation
from config.motion import check_motion, load_motion, sample
from driver.recording import read_recording
from estimator.export import model_urdf
from learner.trial import Reference
from service.practice.controllers import FULL_DYNAMICS, Variant, variants
from service.practice.inverse_models import load_inverse_model
from service.practice.planning import command_delay
from service.practice.trials import trial_of
from service.reports.controller_plot import plot_controllers
from service.sessions.moving import MovingArm
from service.sessions.procedure import Tell, within
from service.sessions.store import Kind, Session

Array = NDArray[np.float64]
LITTLE = 1.5
"""A peak error that the model's dynamics make no more than this many times smaller has another cause."""


class CompareArguments(BaseModel):
    model_config = ConfigDict(extra="forbid")

    motion: str
    model: str | None = None
    """A model file; the arm's URDF when absent."""


class CompareControllers:
    """All plans are checked before the first moves. One under which the arm would be stopped as astray, because its
    servo is told no velocity, is not played: its error is the lag that servo and speed give."""

    kind: Kind = "compare-controllers"

    def __init__(self, installation: Installation, arguments: CompareArguments) -> None:
        self._asked = arguments
        self._installation = installation
        motion = load_motion(arguments.motion, installation)
        self._motion = sample(motion, installation.cycle.rate_hz)
        check_motion(self._motion, installation, motion.name)
        self._model = load_inverse_model(arguments.model, installation)
        # Computed torque looks at a URDF: the bodies that come nearest to the model's.
        urdf = None if arguments.model is None else model_urdf(self._model.model)
        self._variants = [
            v for v in variants(self._motion, self._model, urdf, installation) if v.plan.mode in installation.modes
        ]

    def arguments(self) -> dict[str, Any]:
        return self._asked.model_dump(mode="json")

    async def perform(self, moving: MovingArm, session: Session, tell: Tell) -> dict[str, Any]:
        errors: list[tuple[Variant, Array]] = []
        mode = None
        count = len(self._variants)
        for k, variant in enumerate(self._variants):
            if not variant.within(self._installation):
                errors.append((variant, variant.lag))
                continue
            stage = f"{k + 1} of {count}: {variant.family}, {variant.name}, {variant.rate_hz:.0f} Hz"
            if variant.plan.mode != mode:
                if mode is not None:
                    await moving.disable()
                mode = variant.plan.mode
                await moving.enable(mode)
            begin, middle, end = k / count, (k + 0.5) / count, (k + 1) / count
            await moving.go_to(variant.plan.q[0], mode, within(tell, stage, begin, middle))
            path = await moving.play_recorded(
                variant.plan,
                session,
                {"motion": self._motion.name, "controller": variant.name, "rate_hz": f"{variant.rate_hz:g}"},
                within(tell, stage, middle, end),
            )
            errors.append((variant, await asyncio.to_thread(self._error, path, variant)))
        await moving.disable()
        plot = session.directory / "controllers.png"
        await asyncio.to_thread(plot_controllers, plot, self._motion, self._installation.joint_names, errors)
        return {"session": session.id, **self._answer(errors), "plot": str(plot)}

    def _error(self, path: Path, variant: Variant) -> Array:
        """Wanted minus reached angle (samples × n), rad, in time with the reference."""
        m = self._motion
        whole = slice(0, len(m.q))
        reference = Reference(m.q, m.dq, m.ddq, 1.0 / self._installation.cycle.rate_hz, whole)
        trial = trial_of(read_recording(path), reference, command_delay(variant.plan.mode), str(path))
        return np.asarray(reference.q - trial.q)

    def _answer(self, errors: list[tuple[Variant, Array]]) -> dict[str, Any]:
        joints = self._installation.joint_names
        rows = [
            {
                "controller": variant.name,
                "family": variant.family,
                "rate_hz": variant.rate_hz,
                "peak_deg": _by_joint(joints, np.rad2deg(np.abs(error).max(axis=0))),
                "played": variant.within(self._installation),
                "rms_deg": _by_joint(joints, np.rad2deg(np.sqrt(np.mean(error**2, axis=0)))),
            }
            for variant, error in errors
        ]
        return {
            "motion": self._motion.name,
            "arm": self._installation.arm.name,
            "model": self._model.source,
            "controllers": rows,
            "findings": _findings(rows, joints),
        }


def _by_joint(joints: tuple[str, ...], values: Array) -> dict[str, float]:
    return {joint: float(x) for joint, x in zip(joints, values, strict=True)}


def _findings(rows: list[dict[str, Any]], joints: tuple[str, ...]) -> list[str]:
    """Joints that the rigid bodies' dynamics hardly help, and what effects beside the rigid bodies gain."""
    peaks = {row["controller"]: row["peak_deg"] for row in rows if row["family"] == "hybrid"}
    servo, rigid, named = (
        peaks.get(name)
        for name in ("position and velocity reference, gravity", FULL_DYNAMICS, f"{FULL_DYNAMICS} and named effects")
    )
    assert servo is not None
    assert rigid is not None
    told = [
        f"{joint}: the rigid bodies' feedforward takes its peak error from {servo[joint]:.3g}° to {rigid[joint]:.3g}° "
        "only: what it lacks is no rigid body's (etude diagnose names it)"
        for joint in joints
        if servo[joint] < LITTLE * rigid[joint]
    ]
    if named is not None:
        gains = ", ".join(f"{joint} {rigid[joint]:.3g}° to {named[joint]:.3g}°" for joint in joints)
        most = min(joints, key=lambda joint: named[joint] / rigid[joint])
        told.append(f"{most} gains most by the effects beside the rigid bodies: {gains}")
    return told
