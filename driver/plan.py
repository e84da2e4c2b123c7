"""What the loop is asked to play: a motion sampled at the loop's rate, checked as a whole before anything moves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.schema import Mode

Array = NDArray[np.float64]
Controller = Literal["pd", "pd+ff", "computed_torque"]
ROUNDING = 1e-9
"""Relative slack of the limits, for the last digit of a motion that just touches one."""


@dataclass(frozen=True)
class Plan:
    """A motion to play. Arrays are samples × joints in the installation's order, one row a cycle of the loop.

    ``q`` rad, ``dq`` rad/s, ``ddq`` rad/s², ``tau_ff`` N·m at the joint (the model's torque for the motion; zeros
    when there is none). Mode "csp": the servo is in the drive, dq goes to the velocity offset and tau_ff to the
    torque offset. Mode "cst": the loop's own ``controller`` makes the torque, at ``controller_rate_hz``
    (the installation's when None): "pd", "pd+ff" (adds tau_ff), "computed_torque" (adds, in place of tau_ff, the
    rigid body's torque at the measured state, from ``urdf`` (its text) or else the installation's model).

    Raises InputError when the arrays do not belong together or hold anything but finite numbers.
    """

    q: Array
    dq: Array
    ddq: Array
    tau_ff: Array | None = None
    mode: Mode = "csp"
    controller: Controller = "pd+ff"
    controller_rate_hz: float | None = None
    urdf: str | None = None
    name: str = "motion"
    arrays: tuple[Array, Array, Array, Array] = field(init=False, repr=False)
    """q, dq, ddq, tau_ff as contiguous float64 of one shape."""

    def __post_init__(self) -> None:
        q = np.ascontiguousarray(self.q, dtype=np.float64)
        if q.ndim != 2 or q.shape[0] < 2:
            raise InputError(f"plan {self.name}", f"q has shape {q.shape}", "give at least two samples × joints")
        arrays = [q]
        for label, given in (("dq", self.dq), ("ddq", self.ddq), ("tau_ff", self.tau_ff)):
            array = np.zeros_like(q) if given is None else np.ascontiguousarray(given, dtype=np.float64)
            if array.shape != q.shape:
                raise InputError(f"plan {self.name}", f"{label} has shape {array.shape}, q has {q.shape}")
            arrays.append(array)
        for label, array in zip(("q", "dq", "ddq", "tau_ff"), arrays, strict=True):
            if not np.isfinite(array).all():
                row, joint = (int(k) for k in np.argwhere(~np.isfinite(array))[0])
                raise InputError(
                    f"plan {self.name}",
                    f"{label} of joint number {joint + 1} is {array[row, joint]} at sample {row}",
                    "give finite numbers only",
                )
        object.__setattr__(self, "arrays", tuple(arrays))

    @property
    def samples(self) -> int:
        return int(self.arrays[0].shape[0])

    def check(self, installation: Installation) -> None:
        """Raise InputError naming joint, quantity, time and excess when any sample, or any step between two,
        leaves the installation's limits. The gate looks at every command again when it is played."""
        place = f"plan {self.name}"
        n, rate = len(installation.joint), installation.cycle.rate_hz
        q, dq, ddq, tau_ff = self.arrays
        if q.shape[1] != n:
            raise InputError(place, f"has {q.shape[1]} joints", f"{installation.arm.name} has {n}")
        if self.mode not in installation.modes:
            raise InputError(
                place, f"plays in {self.mode}", f"this installation allows {', '.join(installation.modes)}"
            )
        if self.controller_rate_hz is not None and not 1.0 <= self.controller_rate_hz <= rate * (1 + ROUNDING):
            raise InputError(
                place,
                f"controller_rate_hz is {self.controller_rate_hz:g}",
                f"stay between 1 and the loop's {rate:g} Hz",
            )
        step = np.diff(q, axis=0) * rate
        for i, joint in enumerate(installation.joint):
            limits = joint.limits
            low, high = limits.position_rad
            for what, values, bottom, top, unit in (
                ("position", q[:, i], low, high, "rad"),
                ("velocity", dq[:, i], -limits.velocity_rad_s, limits.velocity_rad_s, "rad/s"),
                ("step between samples", step[:, i], -limits.velocity_rad_s, limits.velocity_rad_s, "rad/s"),
                ("acceleration", ddq[:, i], -limits.acceleration_rad_s2, limits.acceleration_rad_s2, "rad/s²"),
                ("feedforward torque", tau_ff[:, i], -limits.torque_nm, limits.torque_nm, "N·m"),
                (
                    "change of feedforward torque",
                    np.diff(tau_ff[:, i]) * rate,
                    -limits.torque_rate_nm_s,
                    limits.torque_rate_nm_s,
                    "N·m/s",
                ),
            ):
                slack = ROUNDING * max(abs(bottom), abs(top))
                over = np.maximum(values - top, bottom - values)
                worst = int(np.argmax(over))
                if over[worst] > slack:
                    bound = top if values[worst] > top else bottom
                    raise InputError(
                        place,
                        f"{joint.name}: {what} {values[worst]:.4g} {unit} at {worst / rate:.3f} s "
                        f"is {over[worst]:.3g} {unit} beyond its limit {bound:.4g}",
                        "slow the motion down or move it inside the limits",
                    )
