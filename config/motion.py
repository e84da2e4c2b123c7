"""Motions as files: typed TOML, sampled with exact derivatives, held against an installation's limits."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from config.curves import fourier, peaks_of_rest_to_rest, rest_to_rest
from config.errors import InputError
from config.schema import Installation, Positive, Section
from config.toml_file import nearest, read_toml, shown, validate

Array = NDArray[np.float64]
HERE = Path(__file__).parent / "motions"
SLACK = 1e-9
"""Relative slack of the limits, for the last digit of a motion that just touches one."""


class _Motion(Section):
    name: str
    arm: str | None = None
    """The arm it was made for; None fits any with as many joints."""


class PolynomialMotion(_Motion):
    """From rest to rest along straight lines in joint space through way points, one duration a stretch."""

    kind: Literal["polynomial", "minimum_jerk"]
    order: Literal[5, 7] = 5
    way_points_deg: tuple[tuple[float, ...], ...] | None = None
    way_points_rad: tuple[tuple[float, ...], ...] | None = None
    duration_s: tuple[Positive, ...]
    dwell_s: Annotated[float, Field(ge=0)] = 0.0
    """Rest at each inner way point."""

    @model_validator(mode="after")
    def _fits(self) -> PolynomialMotion:
        if (self.way_points_deg is None) == (self.way_points_rad is None):
            raise ValueError("give either way_points_deg or way_points_rad")
        points = self.way_points_deg or self.way_points_rad or ()
        if len(points) < 2 or len({len(p) for p in points}) != 1:
            raise ValueError("way points: give at least two, all with as many angles as the arm has joints")
        if len(self.duration_s) != len(points) - 1:
            raise ValueError(f"duration_s: {len(self.duration_s)} durations for {len(points) - 1} stretches")
        if self.kind == "minimum_jerk" and self.order != 5:
            raise ValueError("order: minimum jerk is the 5th-order polynomial; leave order out")
        return self

    @property
    def points(self) -> Array:
        """Way points × joints [rad]."""
        if self.way_points_rad is not None:
            return np.array(self.way_points_rad, dtype=np.float64)
        return np.array(self.way_points_deg, dtype=np.float64) * (np.pi / 180)

    @property
    def joints(self) -> int:
        return int(self.points.shape[1])


class FourierMotion(_Motion):
    """A periodic motion about a pose; ``sine_rad`` and ``cosine_rad`` are harmonics × joints."""

    kind: Literal["fourier"]
    base_hz: Positive
    periods: Annotated[int, Field(ge=1)] = 2
    centre_rad: tuple[float, ...]
    sine_rad: tuple[tuple[float, ...], ...]
    cosine_rad: tuple[tuple[float, ...], ...]
    fade_s: Positive = 1.0
    """Time over which the motion grows from rest at the beginning and dies away at the end."""

    @model_validator(mode="after")
    def _fits(self) -> FourierMotion:
        rows = {len(r) for r in (*self.sine_rad, *self.cosine_rad)}
        if rows != {len(self.centre_rad)} or len(self.sine_rad) != len(self.cosine_rad):
            raise ValueError("sine_rad and cosine_rad: as many harmonics each, one amplitude a joint in every row")
        return self

    @property
    def joints(self) -> int:
        return len(self.centre_rad)


class RecordedMotion(_Motion):
    """Positions from a CSV file with the header t,q_<joint>…, beside the motion file."""

    kind: Literal["recorded"]
    file: Path
    joints: int = 0
    """Filled in on loading."""


Motion = PolynomialMotion | FourierMotion | RecordedMotion
_KINDS: dict[str, type[PolynomialMotion | FourierMotion | RecordedMotion]] = {
    "polynomial": PolynomialMotion,
    "minimum_jerk": PolynomialMotion,
    "fourier": FourierMotion,
    "recorded": RecordedMotion,
}


@dataclass(frozen=True)
class SampledMotion:
    """``t`` [s], and ``q`` [rad], ``dq`` [rad/s], ``ddq`` [rad/s²], each samples × joints."""

    t: Array
    q: Array
    dq: Array
    ddq: Array


def load_motion(name_or_path: str, installation: Installation) -> Motion:
    """The motion file of that path, or that name in ``config/motions``.

    Raises InputError when it is absent, wrong, made for another arm, or has another number of joints.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = HERE / f"{name_or_path}.toml"
        if not path.exists():
            known = [p.stem for p in HERE.glob("*.toml")]
            raise InputError(f"motion {name_or_path!r}", "there is no such motion", nearest(name_or_path, known))
    data = read_toml(path)
    kind = data.get("kind")
    if kind not in _KINDS:
        raise InputError(f"{shown(path)}: kind", f"{kind!r} is none of {', '.join(_KINDS)}", "choose one of them")
    motion: Motion = validate(_KINDS[kind], {"name": path.stem, **data}, path)
    if isinstance(motion, RecordedMotion):
        file = path.parent / motion.file
        motion = motion.model_copy(update={"file": file, "joints": _read_positions(file)[1].shape[1]})
    name, n = installation.arm.name, len(installation.joint)
    if motion.arm is not None and motion.arm != name:
        raise InputError(shown(path), f"is made for the arm {motion.arm!r}, this is {name!r}", "choose another motion")
    if motion.joints != n:
        raise InputError(shown(path), f"has {motion.joints} joints, {name} has {n}", "give one angle a joint")
    return motion


def sample(motion: Motion, rate_hz: float) -> SampledMotion:
    """The motion at ``rate_hz``, with exact derivatives; it begins and ends at rest.

    A recorded motion is interpolated by a quintic spline, whose derivatives are taken.
    """
    if isinstance(motion, PolynomialMotion):
        return _sample_polynomial(motion, rate_hz)
    if isinstance(motion, FourierMotion):
        return _sample_fourier(motion, rate_hz)
    from scipy.interpolate import make_interp_spline

    at, q = _read_positions(motion.file)
    t = _times(float(at[-1] - at[0]), rate_hz)
    spline = make_interp_spline(at - at[0], q, k=5)
    return SampledMotion(t, spline(t), spline(t, nu=1), spline(t, nu=2))


def check_motion(sampled: SampledMotion, installation: Installation, name: str = "motion") -> None:
    """Raise InputError naming joint, quantity, time and excess when the motion leaves a limit, and the slowest
    duration that would fit where slowing down helps."""
    if sampled.q.shape[1] != len(installation.joint):
        raise InputError(
            name, f"has {sampled.q.shape[1]} joints", f"{installation.arm.name} has {len(installation.joint)}"
        )
    duration, slower, worst = float(sampled.t[-1]), 1.0, ""
    for i, joint in enumerate(installation.joint):
        limits = joint.limits
        low, high = limits.position_rad
        q = sampled.q[:, i]
        over = np.maximum(q - high, low - q)
        k = int(np.argmax(over))
        if over[k] > SLACK * max(1.0, abs(low), abs(high)):
            bound = high if q[k] > high else low
            raise InputError(
                name,
                f"{joint.name} reaches {q[k]:.4g} rad at {sampled.t[k]:.3f} s, {over[k]:.3g} rad beyond {bound:g}",
                f"keep it between {low:g} and {high:g} rad",
            )
        for what, values, limit, unit, power in (
            ("velocity", sampled.dq[:, i], limits.velocity_rad_s, "rad/s", 1.0),
            ("acceleration", sampled.ddq[:, i], limits.acceleration_rad_s2, "rad/s²", 0.5),
        ):
            k = int(np.argmax(np.abs(values)))
            excess = abs(float(values[k])) / limit
            if excess > 1 + SLACK and excess**power > slower:
                slower = excess**power
                worst = (
                    f"{joint.name}: {what} {values[k]:.4g} {unit} at {sampled.t[k]:.3f} s "
                    f"is {abs(values[k]) - limit:.3g} {unit} beyond its limit {limit:g}"
                )
    if worst:
        raise InputError(name, worst, f"it fits when played in {duration * slower:.3f} s instead of {duration:.3f} s")


def point_to_point(q0: Array, q1: Array, installation: Installation, speed: float = 0.5) -> SampledMotion:
    """A 5th-order move from ``q0`` to ``q1`` [rad], as fast as ``speed`` times the velocity and acceleration limits.

    Raises InputError when an end lies outside the position limits.
    """
    q0, q1 = np.asarray(q0, dtype=np.float64), np.asarray(q1, dtype=np.float64)
    way = np.abs(q1 - q0)
    peak_dq, peak_ddq = peaks_of_rest_to_rest(5)
    velocity = np.array([j.limits.velocity_rad_s for j in installation.joint]) * speed
    acceleration = np.array([j.limits.acceleration_rad_s2 for j in installation.joint]) * speed**2
    duration = max(float(np.max(way * peak_dq / velocity)), float(np.sqrt(np.max(way * peak_ddq / acceleration))), 0.1)
    t = _times(duration, installation.cycle.rate_hz)
    moved = SampledMotion(t, *rest_to_rest(q0, q1, float(t[-1]), 5, t))
    check_motion(moved, installation, "point to point")
    return moved


def _times(duration_s: float, rate_hz: float) -> Array:
    return np.arange(max(2, round(duration_s * rate_hz) + 1)) / rate_hz


def _sample_polynomial(motion: PolynomialMotion, rate_hz: float) -> SampledMotion:
    parts: list[tuple[Array, Array, Array]] = []
    points = motion.points
    still = round(motion.dwell_s * rate_hz)
    for k, duration in enumerate(motion.duration_s):
        t = _times(duration, rate_hz)
        q, dq, ddq = rest_to_rest(points[k], points[k + 1], float(t[-1]), motion.order, t)
        first = 0 if k == 0 else 1
        parts.append((q[first:], dq[first:], ddq[first:]))
        if still and k + 1 < len(motion.duration_s):
            zero = np.zeros((still, points.shape[1]))
            parts.append((np.tile(points[k + 1], (still, 1)), zero, zero))
    q, dq, ddq = (np.concatenate(column) for column in zip(*parts, strict=True))
    return SampledMotion(np.arange(len(q)) / rate_hz, q, dq, ddq)


def _sample_fourier(motion: FourierMotion, rate_hz: float) -> SampledMotion:
    period = 1 / motion.base_hz
    total = motion.periods * period + 2 * motion.fade_s
    t = _times(total, rate_hz)
    centre = np.array(motion.centre_rad)
    q, dq, ddq = fourier(
        centre, np.array(motion.sine_rad), np.array(motion.cosine_rad), motion.base_hz, t - motion.fade_s
    )
    # Grown and faded by a rest-to-rest envelope, so that whole periods in between are exactly periodic.
    one = np.ones(1)
    x = np.clip(np.minimum(t, t[-1] - t) / motion.fade_s, 0, 1)
    g, dg, ddg = rest_to_rest(0 * one, one, motion.fade_s, 5, x * motion.fade_s)
    sign = np.where(t < t[-1] / 2, 1.0, -1.0)[:, None]
    dg = sign * dg
    off = q - centre
    return SampledMotion(t, centre + g * off, g * dq + dg * off, g * ddq + 2 * dg * dq + ddg * off)


def _read_positions(path: Path) -> tuple[Array, Array]:
    try:
        with path.open(encoding="utf-8") as lines:
            header = lines.readline().strip().split(",")
            table = np.loadtxt(lines, delimiter=",", ndmin=2)
    except FileNotFoundError:
        raise InputError(shown(path), "there is no such file", "check the motion's key 'file'") from None
    except ValueError as error:
        raise InputError(
            shown(path), f"is not a table of numbers ({error})", "give t,q_<joint>… in s and rad"
        ) from None
    columns = [k for k, name in enumerate(header) if name.startswith("q_")]
    if header[:1] != ["t"] or not columns or table.shape[1] != len(header) or len(table) < 6:
        raise InputError(shown(path), f"has the header {','.join(header)}", "give t,q_<joint>… and at least six rows")
    t = table[:, 0]
    if not (np.isfinite(table).all() and (np.diff(t) > 0).all()):
        raise InputError(shown(path), "has times that do not rise, or entries that are not finite", "mend those rows")
    return t, table[:, columns]
