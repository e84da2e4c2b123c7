"""Designs the motion that tells the most about an arm's links, and writes it as a motion file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.motion import check_motion, load_motion, sample
from config.toml_file import shown
from estimator.base_parameters import base_parameters
from estimator.excitation import Information, MotionBasis, MotionLimits, design, fourier_basis, judge
from estimator.rigid_body import RigidBody
from service.identification.arm_source import of_installation
from service.models.toml_text import literal
from service.sessions.store import write_atomically

Array = NDArray[np.float64]

BASE_HZ, HARMONICS, PERIODS = 0.1, 5, 2
"""Two periods, so that what differs between them is noise."""
SAMPLES = 60
"""A period: the fifth harmonic has twelve."""
NOISE_SHARE = 0.01
"""rms noise of a torque channel, share of the joint's limit, when none is known."""
HEIGHTS_HZ = 50.0
"""At which the played poses are held above the floor."""
FADES_S = (1.5, 3.0, 5.0, 8.0, 12.0)
"""Rise and fall add to velocities and accelerations: the shortest that keeps the limits is taken."""
SIZES = tuple(0.95**k for k in range(20))
"""And when none does, the motion becomes smaller."""


@dataclass(frozen=True)
class DesignReport:
    """The file, and how much it tells: log determinants of the information, and the largest relative standard error of
    a base parameter, beside those of the arm's own identification motions cut or repeated to the same duration."""

    path: Path
    seconds: float
    log_determinant: float
    worst_standard_error: float
    own_log_determinant: float | None
    own_worst_standard_error: float | None

    @property
    def sentence(self) -> str:
        """For a person."""
        text = f"designed {self.path}: {self.seconds:.0f} s, largest standard error {self.worst_standard_error:.3g}"
        if self.own_worst_standard_error is None:
            return text
        return f"{text}, where the arm's own motions for as long leave {self.own_worst_standard_error:.3g}"


def design_motion(installation: Installation, path: Path, seed: int = 0) -> DesignReport:
    """Designs a Fourier motion within the limits of ``installation`` and writes its file to ``path``.

    The limits of torque are held by the URDF's masses where it has some. The file is checked as any motion is before
    it is played. Raises InputError when the limits allow no motion.
    """
    arm = of_installation(installation)
    body = arm.rigid_body(installation.joint_names, {})
    limits, information = limits_of(installation, body), information_of(installation, body)
    seconds = PERIODS / BASE_HZ
    basis = fourier_basis(BASE_HZ, HARMONICS, SAMPLES)
    best = design(information, basis, limits, seconds, seed, starts=1)
    coefficients = _write_what_can_be_played(installation, body, path, basis, best.coefficients)
    told, errors, _ = judge(information, limits, *basis.motion(coefficients), seconds)
    own = _own_motions(installation, seconds)
    own_told, own_errors = (None, None)
    if own is not None:
        own_told, all_errors, _ = judge(information, limits, *own, seconds)
        own_errors = float(all_errors.max())
    return DesignReport(path, seconds, told, float(errors.max()), own_told, own_errors)


def _write_what_can_be_played(
    installation: Installation, body: RigidBody, path: Path, basis: MotionBasis, coefficients: Array
) -> Array:
    """Writes the file with the first fade and size that pass the check of every motion and stay above the floor;
    returns what was written."""
    limits = limits_of(installation, body)
    for size in SIZES:
        smaller = basis.towards_centre(coefficients, size)
        for fade in FADES_S:
            write_atomically(path, _motion_file(installation, smaller, fade))
            played = sample(load_motion(str(path), installation), installation.cycle.rate_hz)
            try:
                check_motion(played, installation)
            except InputError:
                continue
            way = np.linspace(installation.arm.home_rad, played.q[0], SAMPLES)
            thinned = played.q[:: max(1, int(installation.cycle.rate_hz / HEIGHTS_HZ))]
            if limits.below_floor(body, np.concatenate([way, thinned])) == 0.0:
                return smaller
    path.unlink()
    raise InputError(installation.arm.name, "has limits that allow no motion of this kind", "check the limits")


def limits_of(installation: Installation, body: RigidBody) -> MotionLimits:
    """The limits of an installation's joints, and its floor; of torque by the URDF's masses, a tenth of it left to
    control. Where the middle of the joints' ranges lies below the floor, motions stand about the home. Raises
    InputError when the home is below the floor."""
    limits = [joint.limits for joint in installation.joint]
    parameters = body.prior() if np.any(body.prior()[::10] > 0.0) else None
    found = MotionLimits(
        lower=np.array([x.position_rad[0] for x in limits]),
        upper=np.array([x.position_rad[1] for x in limits]),
        velocity=np.array([x.velocity_rad_s for x in limits]),
        acceleration=np.array([x.acceleration_rad_s2 for x in limits]),
        torque=None if parameters is None else np.array([0.9 * x.torque_nm for x in limits]),
        parameters=parameters,
        floor=installation.arm.floor_m,
        tips=(_tool_point(body, installation.arm.tool_frame),),
    )
    home = np.array(installation.arm.home_rad)
    if (sunk := found.below_floor(body, home[None])) > 0.0:
        raise InputError(
            f"{shown(installation.path)}: arm.floor_m",
            f"the arm's home is {sunk:.3g} m below {installation.arm.floor_m:g} m",
            "give the height of what stands below the arm, in the base's frame",
        )
    return found if found.below_floor(body, found.centre[None]) == 0.0 else replace(found, stand=home)


def _tool_point(body: RigidBody, frame: str) -> tuple[float, float, float]:
    """The tool frame's origin on the last link, m."""
    x, y, z = body.model.frames[body.model.getFrameId(frame)].placement.translation
    return float(x), float(y), float(z)


def information_of(installation: Installation, body: RigidBody) -> Information:
    """Torques with noise in proportion to the joints' limits, read at the loop's rate."""
    base = base_parameters(body)
    noise = np.array([NOISE_SHARE * joint.limits.torque_nm for joint in installation.joint])
    return Information(body, base, noise, installation.cycle.rate_hz, scale=np.full(base.rank, 100.0))


def _own_motions(installation: Installation, seconds: float) -> tuple[Array, Array, Array] | None:
    """The installation's identification motions behind one another, as long as is given to the design."""
    names = installation.arm.identification_motions
    if not names:
        return None
    rate = SAMPLES * BASE_HZ * 4.0
    sampled = [sample(load_motion(name, installation), rate) for name in names]
    q, dq, ddq = (np.concatenate([getattr(s, quantity) for s in sampled]) for quantity in ("q", "dq", "ddq"))
    count = round(seconds * rate)
    repeated = np.resize(np.arange(len(q)), count)
    return q[repeated], dq[repeated], ddq[repeated]


def _motion_file(installation: Installation, coefficients: Array, fade_s: float) -> str:
    rows = {
        "centre_rad": coefficients[0].tolist(),
        "sine_rad": coefficients[1 : HARMONICS + 1].tolist(),
        "cosine_rad": coefficients[HARMONICS + 1 :].tolist(),
    }
    lines = [
        "# Designed for the determinant of the information about the links, within the arm's limits.",
        'kind = "fourier"',
        f"arm = {literal(installation.arm.name)}",
        f"base_hz = {BASE_HZ}",
        f"periods = {PERIODS}",
        f"fade_s = {fade_s}",
        *(f"{key} = {literal(value)}" for key, value in rows.items()),
    ]
    return "\n".join(lines) + "\n"
