"""Whether the configured gains hold the arm that the URDF describes, before any drive is enabled with them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from config import Installation
from learner.linearisation import linearise
from learner.servo_poles import swinging
from service.checks.finding import Finding
from service.practice.inverse_models import load_inverse_model
from service.practice.planning import feedback_loop

AREA = "description"
POSES = 40
"""Over the range of the joints, beside home: a light pose swings where a heavy one does not."""


def check_servos(installation: Installation) -> Iterator[Finding]:
    """The poles of the closed loop, at rest in poses over the arm's range, in each mode."""
    home = np.array(installation.arm.home_rad)
    low, high = np.array([joint.limits.position_rad for joint in installation.joint]).T
    poses = np.vstack([home, np.random.default_rng(1).uniform(low, high, (POSES, len(home)))])
    still = np.zeros_like(poses)
    arm = linearise(load_inverse_model(None, installation).momentary, poses, still, still)
    for mode in installation.modes:
        subject = f"{'servo' if mode == 'csp' else 'digital'} gains, {mode}"
        found = swinging(arm, feedback_loop(installation, mode))
        if found is None:
            yield Finding(AREA, subject, "ok", "hold the arm that the URDF describes, all over its range")
            continue
        pose = ", ".join(f"{angle:.2g}" for angle in poses[found.instant])
        yield Finding(
            AREA,
            subject,
            "warn",
            f"{installation.joint[found.joint].name} would swing at {found.frequency:.3g} Hz, {found.growth:.3g} times "
            f"as far each sample, at ({pose}) rad",
            "lower the gains; or, if the arm is at rest under them, the URDF lacks the rotors: identify the links",
        )
