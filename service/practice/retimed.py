"""A motion re-timed to what the arm can do, kept as a motion file (Section 7.3)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.motion import SampledMotion, check_motion, fitting_duration, load_motion, sample
from learner.retiming import PathLimits, reserve, retime
from service.practice.inverse_models import load_inverse_model
from service.sessions.store import write_atomically

Array = NDArray[np.float64]
SHARE = 0.9
"""Of the velocity and acceleration limits: the file's spline goes through the samples, not through their limits."""
ROUNDS, SLACK = 4, 1e-3
EVERY_S = 0.005
"""Between the path's samples in the file."""


def retimed_motion(
    name: str, model_name: str | None, errors: tuple[float, float], installation: Installation, out: Path
) -> dict[str, Any]:
    """Re-time the motion of that name or file and write it as ``out`` (TOML) with its path beside it (CSV).

    ``errors``: largest angle [rad] and velocity [rad/s] error that was measured in tracking; what the servo answers to
    them is taken off the torque limits. Returns the answer of `etude retime`.
    Raises InputError when the motion or the model is not of this arm, or the limits admit no motion along the path.
    """
    motion = load_motion(name, installation)
    sampled = sample(motion, installation.cycle.rate_hz)
    model = load_inverse_model(model_name, installation)
    joints = installation.joint
    torque = np.array([j.limits.torque_nm for j in joints])
    gains = np.array([[j.servo.stiffness_nm_rad, j.servo.damping_nms_rad] for j in joints])
    angle_error, speed_error = (np.full(len(joints), error) for error in errors)
    left = reserve(torque, gains[:, 0], gains[:, 1], angle_error, speed_error)
    if (left <= 0.0).any():
        joint = joints[int(np.argmin(left))]
        raise InputError(
            f"{joint.name}",
            f"its servo alone would use {joint.limits.torque_nm - left.min():.4g} N·m on these tracking errors, of "
            f"{joint.limits.torque_nm:.4g} N·m",
            "practise first, or give smaller errors",
        )
    limits = PathLimits(
        left,
        SHARE * np.array([j.limits.velocity_rad_s for j in joints]),
        SHARE * np.array([j.limits.acceleration_rad_s2 for j in joints]),
    )
    # The programme asks for torques at separate points of the path.
    found = retime(model.momentary, sampled.q, limits, EVERY_S, motion.name)
    t = found.t
    played = _written(t, found.q, installation, motion.name, out)
    # The spline through the samples rounds off the jumps of acceleration, and rings a little: slowed until it fits.
    for _ in range(ROUNDS):
        slower = fitting_duration(played, installation) / played.duration_s
        if slower <= 1.0:
            break
        t = t * slower * (1.0 + SLACK)
        played = _written(t, found.q, installation, motion.name, out)
    check_motion(played, installation, str(out))
    used = np.max(np.abs(model.torque(played.q, played.dq, played.ddq)) / torque, axis=0)
    return {
        "motion": motion.name,
        "arm": installation.arm.name,
        "model": model.source,
        "duration_before_s": sampled.duration_s,
        "duration_s": played.duration_s,
        "largest_share_of_torque_limit": dict(zip(installation.joint_names, used.tolist(), strict=True)),
        "retimed": str(out),
    }


def _written(t: Array, q: Array, installation: Installation, name: str, out: Path) -> SampledMotion:
    """Write the motion's file and its path; returns it as the loop will play it."""
    names = installation.joint_names
    path = out.with_suffix(".csv")
    lines = [",".join(["t", *(f"q_{joint}" for joint in names)])]
    lines += [",".join([f"{at:.6f}", *(f"{x:.9f}" for x in row)]) for at, row in zip(t, q, strict=True)]
    try:
        write_atomically(path, "\n".join(lines) + "\n")
        head = f"# {name}, re-timed to the arm's limits."
        write_atomically(out, f'{head}\nkind = "recorded"\narm = "{installation.arm.name}"\nfile = "{path.name}"\n')
    except OSError as error:
        raise InputError(str(out), f"cannot be written ({error.strerror})", "choose another --out") from None
    return sample(load_motion(str(out), installation), installation.cycle.rate_hz)
