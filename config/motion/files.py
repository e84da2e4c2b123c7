"""Motion files: typed TOML of four kinds, by name or by path, in the order of the installation's joints."""

from __future__ import annotations

import os
import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from config.errors import InputError, WrongKey
from config.motion.curves import Array, Curve, Fourier, RestToRest, Spline
from config.motion.recorded import read_path
from config.schema import Installation, Name, Positive, Section
from config.section import FilePath
from config.toml_file import nearest, read_toml, shown, validate

NAME = re.compile(r"[\w.+@-]{1,200}")
"""What a motion without a path is called."""
LONGEST_S = 3600.0
"""A motion is sampled at every cycle, as a whole, before it is played."""
SHIPPED = Path(__file__).parent.parent / "motions"
NotNegative = Annotated[float, Field(ge=0)]
Rows = Annotated[tuple[tuple[float, ...], ...], Field(min_length=1)]


@dataclass(frozen=True)
class Motion:
    """A motion of all joints of an installation, in its order."""

    name: str
    description: str
    joints: tuple[str, ...]
    curve: Curve

    @property
    def duration_s(self) -> float:
        return self.curve.duration_s


class MotionFile(Section, ABC):
    """What every kind has."""

    description: str = ""
    arm: Name | None = None
    """The arm it is made for; absent, it fits any arm with these joints."""
    joints: Annotated[tuple[Name, ...], Field(min_length=1)] | None = None
    """The joints of the columns; the installation's others stay at home. Absent: all, in the installation's order."""

    @abstractmethod
    def curve(self, joints: Joints, beside: Path) -> Curve:
        """The curve of all joints; files it names lie in the folder ``beside``."""


@dataclass(frozen=True)
class Joints:
    """The joints that a file moves (``names``), as column numbers among the installation's, which rest at ``home``."""

    names: tuple[str, ...]
    numbers: tuple[int, ...]
    home: Array
    place: str

    def poses(self, key: str, rows: Sequence[Sequence[float]]) -> Array:
        """Rows of angles of the file's joints as poses of all joints. Raises InputError for a row of wrong length."""
        whole = np.tile(self.home, (len(rows), 1))
        whole[:, list(self.numbers)] = self._checked(key, rows)
        return whole

    def amplitudes(self, key: str, rows: Sequence[Sequence[float]]) -> Array:
        """The same for amplitudes, which are zero for joints that rest."""
        whole = np.zeros((len(rows), len(self.home)))
        whole[:, list(self.numbers)] = self._checked(key, rows)
        return whole

    def _checked(self, key: str, rows: Sequence[Sequence[float]]) -> Array:
        for k, row in enumerate(rows):
            if len(row) != len(self.names):
                raise InputError(
                    f"{self.place}: {key}[{k}]",
                    f"has {len(row)} values for {len(self.names)} joints",
                    f"give one each for {', '.join(self.names)}",
                )
        return np.array(rows, dtype=float)


class ThroughPoints(MotionFile):
    """Way points, a row each, in degrees or in rad; ``duration_s`` is one number for all stretches, or one for each."""

    way_points_deg: Rows | None = None
    way_points_rad: Rows | None = None
    duration_s: tuple[Positive, ...]

    @field_validator("duration_s", mode="before")
    @classmethod
    def _for_all(cls, value: Any) -> Any:
        return (value,) if isinstance(value, int | float) else value

    @model_validator(mode="after")
    def _stretches(self) -> ThroughPoints:
        if (self.way_points_deg is None) == (self.way_points_rad is None):
            raise WrongKey("way_points_rad", "and way_points_deg exclude each other", "give exactly one of the two")
        key, rows = self._given
        if len(rows) < 2:
            raise WrongKey(key, "has a single way point", "give where the motion begins and where it ends")
        if len(self.duration_s) not in (1, len(rows) - 1):
            raise WrongKey(
                "duration_s",
                f"has {len(self.duration_s)} durations for {len(rows) - 1} stretches",
                "give one a stretch",
            )
        return self

    @property
    def _given(self) -> tuple[str, Sequence[Sequence[float]]]:
        if self.way_points_rad is not None:
            return "way_points_rad", self.way_points_rad
        return "way_points_deg", self.way_points_deg or ()

    def points(self, joints: Joints) -> Array:
        """Points × joints in rad."""
        key, rows = self._given
        unit = 1.0 if key == "way_points_rad" else np.pi / 180
        return joints.poses(key, [[angle * unit for angle in row] for row in rows])

    def durations(self) -> list[float]:
        stretches = len(self._given[1]) - 1
        return list(self.duration_s) * (stretches if len(self.duration_s) == 1 else 1)


class PolynomialFile(ThroughPoints):
    """From rest to rest between way points by polynomials of 5th or 7th order; ``dwell_s`` at each inner one."""

    kind: Literal["polynomial"]
    order: Literal[5, 7] = 5
    dwell_s: NotNegative = 0.0

    def curve(self, joints: Joints, beside: Path) -> Curve:
        return RestToRest(self.points(joints), self.durations(), self.order, self.dwell_s)


class MinimumJerkFile(ThroughPoints):
    """Through the inner way points without a stop, with the least jerk."""

    kind: Literal["minimum_jerk"]

    def curve(self, joints: Joints, beside: Path) -> Curve:
        return Spline(np.concatenate(([0.0], np.cumsum(self.durations()))), self.points(joints))


class FourierFile(MotionFile):
    """Harmonics of one base frequency about a centre: ``sine_rad`` and ``cosine_rad`` have a row a harmonic.

    ``periods`` whole periods at full amplitude, between a rise and a fall of ``fade_s`` each.
    """

    kind: Literal["fourier"]
    base_hz: Positive
    periods: Annotated[int, Field(ge=1)] = 2
    fade_s: Positive = 1.0
    centre_rad: tuple[float, ...]
    sine_rad: Rows
    cosine_rad: Rows

    @model_validator(mode="after")
    def _harmonics(self) -> FourierFile:
        if len(self.sine_rad) != len(self.cosine_rad):
            raise WrongKey(
                "cosine_rad",
                f"has {len(self.cosine_rad)} harmonics where sine_rad has {len(self.sine_rad)}",
                "give as many rows in both",
            )
        return self

    def curve(self, joints: Joints, beside: Path) -> Curve:
        return Fourier(
            joints.poses("centre_rad", [self.centre_rad])[0],
            joints.amplitudes("sine_rad", self.sine_rad),
            joints.amplitudes("cosine_rad", self.cosine_rad),
            self.base_hz,
            self.periods / self.base_hz,
            self.fade_s,
        )


class RecordedFile(MotionFile):
    """A path from a CSV file, beside the motion file, with the columns ``t`` [s] and ``q_<joint>`` [rad]."""

    kind: Literal["recorded"]
    file: FilePath
    cutoff_hz: Positive | None = None
    """Zero-phase low-pass for measured angles; a commanded path needs none."""

    def curve(self, joints: Joints, beside: Path) -> Curve:
        t, q = read_path(beside / self.file, joints.names, self.cutoff_hz)
        return Spline(t, joints.poses("file", q.tolist()))


KINDS: dict[str, type[PolynomialFile | MinimumJerkFile | FourierFile | RecordedFile]] = {
    "polynomial": PolynomialFile,
    "minimum_jerk": MinimumJerkFile,
    "fourier": FourierFile,
    "recorded": RecordedFile,
}


def load_motion(name_or_path: str, installation: Installation) -> Motion:
    """The motion of that name (beside the installation, else shipped) or file, for the joints of ``installation``.

    Raises InputError naming file and key: an unknown name, a wrong file, another arm, joints that the arm has not.
    The limits are not looked at; `config.motion.check_motion` does.
    """
    path = _path(name_or_path, installation)
    data = read_toml(path)
    place, kind = shown(path), data.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        problem = "is missing" if kind is None else f"{kind!r} is no kind of motion"
        raise InputError(f"{place}: kind", problem, f"choose one of {', '.join(KINDS)}")
    file = validate(KINDS[kind], data, path)
    arm, names = installation.arm.name, installation.joint_names
    if file.arm not in (None, arm):
        raise InputError(f"{place}: arm", f"it is made for {file.arm}, this arm is {arm}", "choose another motion")
    moved = file.joints or names
    for k, joint in enumerate(moved):
        if joint not in names:
            raise InputError(f"{place}: joints[{k}]", f"{joint!r} is no joint of {arm}", nearest(joint, names))
        if joint in moved[:k]:
            raise InputError(f"{place}: joints[{k}]", f"{joint!r} is named twice", "name each joint once")
    joints = Joints(moved, tuple(names.index(j) for j in moved), np.array(installation.arm.home_rad), place)
    curve = file.curve(joints, path.parent)
    if curve.duration_s > LONGEST_S:
        raise InputError(
            place, f"lasts {curve.duration_s:.4g} s, and a motion {LONGEST_S:g} s at most", "play it in parts"
        )
    return Motion(path.stem, file.description, names, curve)


def folder_beside(installation: Installation) -> Path:
    """Where an installation keeps motions of its own."""
    return installation.path.parent / "motions"


def known_motions(installation: Installation) -> tuple[str, ...]:
    """Names of the motions beside the installation file, and of those that come with Étude for this arm."""
    beside = {p.stem for p in folder_beside(installation).glob("*.toml")}
    shipped = {p.stem for p in SHIPPED.glob("*.toml") if read_toml(p).get("arm") == installation.arm.name}
    return tuple(sorted(beside | shipped))


def _path(name_or_path: str, installation: Installation) -> Path:
    if name_or_path.endswith(".toml") or os.sep in name_or_path:
        try:
            return Path(name_or_path).expanduser().absolute()
        except RuntimeError:
            raise InputError(f"motion {name_or_path!r}", "there is no such user", "give the whole path") from None
    folders = (folder_beside(installation), SHIPPED) if NAME.fullmatch(name_or_path) else ()
    for folder in folders:
        if (path := folder / f"{name_or_path}.toml").exists():
            return path
    known = known_motions(installation)
    raise InputError(
        f"motion {name_or_path!r}",
        f"there is no such motion for {installation.arm.name}",
        nearest(name_or_path, known) if known else f"write it as {folder_beside(installation)}/NAME.toml",
    )
