"""The controllers of Appendix A as plans: five with the servo in the drive, three in the loop at two rates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import Installation
from config.motion import SampledMotion
from config.schema import Mode
from driver.plan import Controller, Plan
from service.practice.inverse_models import ArmTorques

Array = NDArray[np.float64]
FULL_DYNAMICS, FEEDFORWARD = "full dynamics", "feedforward"
NEAR_ENOUGH = 0.9
"""Of ``following_error_rad``."""
SLOW_HZ = 133.0
"""The Motorola 68000's rate."""


@dataclass(frozen=True)
class Variant:
    """One controller: what it is called, and what the loop plays"""

    name: str
    family: str
    """"hybrid": the servo is in the drive; "digital": in the loop."""
    rate_hz: float
    plan: Plan
    lag: Array
    """(samples × n) rad by which a servo without a velocity reference falls behind: its damping holds it back."""

    def within(self, installation: Installation) -> bool:
        """Whether it stays so near to its reference that the arm is not stopped as astray."""
        limits = np.array([joint.limits.following_error_rad for joint in installation.joint])
        return bool((np.abs(self.lag).max(axis=0) < NEAR_ENOUGH * limits).all())


def variants(motion: SampledMotion, model: ArmTorques, urdf: str | None, installation: Installation) -> list[Variant]:
    """All of Appendix A, and where the model has more than rigid bodies, both feedforwards with all it has.

    ``urdf``: text of the model that computed torque uses; the installation's when None.
    Raises InputError when a plan leaves a limit.
    """
    rate = installation.cycle.rate_hz
    gravity = model.gravity(motion.q)
    rigid = model.rigid(motion.q, motion.dq, motion.ddq)
    zero = np.zeros_like(motion.q)
    hybrid: list[tuple[str, Array, Array]] = [
        ("position reference", zero, zero),
        ("position reference, gravity", zero, gravity),
        ("position and velocity reference", motion.dq, zero),
        ("position and velocity reference, gravity", motion.dq, gravity),
        (FULL_DYNAMICS, motion.dq, rigid),
    ]
    digital: list[tuple[str, Controller, Array]] = [
        ("PD", "pd", zero),
        (FEEDFORWARD, "pd+ff", rigid),
        ("computed torque", "computed_torque", zero),
    ]
    whole = model.torque(motion.q, motion.dq, motion.ddq)
    if model.model.effects:
        hybrid.append((f"{FULL_DYNAMICS} and named effects", motion.dq, whole))
        digital.append((f"{FEEDFORWARD} and named effects", "pd+ff", whole))
    slope = np.array([joint.servo.damping_nms_rad / joint.servo.stiffness_nm_rad for joint in installation.joint])
    found = [
        Variant(
            name, "hybrid", rate, _plan(motion, dq, tau, "csp", "pd+ff", None, None, name), slope * (motion.dq - dq)
        )
        for name, dq, tau in hybrid
    ]
    for hertz in (min(SLOW_HZ, rate), rate):
        found += [
            Variant(
                name,
                "digital",
                hertz,
                _plan(motion, motion.dq, tau, "cst", kind, hertz, urdf, f"{name} {hertz:.0f}"),
                zero,
            )
            for name, kind, tau in digital
        ]
    for variant in found:
        variant.plan.check(installation)
    return found


def _plan(
    motion: SampledMotion,
    dq: Array,
    tau: Array,
    mode: Mode,
    controller: Controller,
    rate_hz: float | None,
    urdf: str | None,
    name: str,
) -> Plan:
    # Spaces and commas do not belong into the names of recordings.
    plain = "-".join(name.replace(",", "").split())
    return Plan(motion.q, dq, motion.ddq, tau, mode, controller, rate_hz, urdf, f"{motion.name}-{plain}")
