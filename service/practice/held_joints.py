"""Joints that their dry friction holds off their start: told with the certificate, and with what a practice came to."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from service.practice.course import Course

Array = NDArray[np.float64]
MANY_TIMES = 20.0
"""The floor, that a joint's release from friction adds to the first trial's error, from which on the joint is told of:
practice leaves a twentieth of it or more where it is strong (docs/practice.md), and that is as much as the floor."""


def held_answer(found: Course, floor: Array, floor_name: str) -> dict[str, Any]:
    """``sticking`` by joint, and ``held_joints``: a sentence for each joint whose release is `MANY_TIMES` its ``floor``
    (n,) rad/s or more. Where the floor is zero it is not known, and nothing is said."""
    sticks, practised = found.sticking, found.practised
    names = practised.installation.joint_names
    keys = {
        "dry_friction": sticks.friction,
        "stick_band": sticks.band,
        "held": sticks.held,
        "velocity_error_rms": sticks.velocity_error,
    }
    told = []
    for i in np.flatnonzero((floor > 0.0) & (sticks.velocity_error >= MANY_TIMES * floor)):
        friction, band, error = sticks.friction[i], sticks.band[i], sticks.velocity_error[i]
        counts, stiffness = band / practised.count_rad[i], practised.loop.stiffness[i]
        told.append(
            f"{names[i]} may stay above repeatability: by the model dry friction of {friction:.3g} N·m holds it up to "
            f"{1e3 * band:.3g} mrad ({counts:.0f} counts) from its start, where its servo of {stiffness:g} N·m/rad "
            f"cannot move it; it lets go {1e3 * sticks.held[i]:.0f} ms after the motion's begin, which adds "
            f"{error:.3g} rad/s RMS to the first trial's error, {error / floor[i]:.0f} × {floor_name}"
        )
    return {
        "sticking": {name: {key: float(x[i]) for key, x in keys.items()} for i, name in enumerate(names)},
        "held_joints": told,
    }
