"""Recordings as CSV: ``t,q_<joint>…,dq_<joint>…,tau_<joint>…[,fx,fy,fz,nx,ny,nz]`` in SI units, one row a sample.

Where the joints have torque sensors, ``tau_…`` is theirs, and ``tau_motor_<joint>…`` may hold the torques of the motors
by their currents, at the joints. Where joints have encoders on both sides of their gears, ``q_…`` is of those behind
them, and ``q_motor_<joint>…`` may hold the angles of those joints' motors, at the joints. ``temperature_<joint>…`` may
hold what joints were warm, °C.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from config import InputError
from driver.recording.recording import Array, Recording, find_gaps

WRENCH_COLUMNS = ("fx", "fy", "fz", "nx", "ny", "nz")
QUANTITIES = ("q", "dq", "tau")
MOTOR = "tau_motor"
MOTOR_ANGLE = "q_motor"
TEMPERATURE = "temperature"
_SHOWN = 40
"""Characters of a field that is no number: a damaged file may hold thousands."""
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


@dataclass(frozen=True)
class _Header:
    names: tuple[str, ...]
    joints: tuple[str, ...]

    def columns(self, quantity: str) -> list[int] | None:
        wanted = [f"{quantity}_{joint}" for joint in self.joints]
        return [self.names.index(name) for name in wanted] if wanted[0] in self.names else None

    def some(self, quantity: str) -> dict[int, int]:
        """By joint the column of a quantity that some joints have."""
        named = {k: f"{quantity}_{joint}" for k, joint in enumerate(self.joints)}
        return {k: self.names.index(name) for k, name in named.items() if name in self.names}

    @property
    def wrench(self) -> list[int] | None:
        return [self.names.index(name) for name in WRENCH_COLUMNS] if "fx" in self.names else None


def read_csv(path: Path) -> Recording:
    """Read a CSV recording. ``dq_…``, ``tau_…``, ``tau_motor_…`` and the wrench may be absent, each as a whole,
    ``q_motor_…`` and ``temperature_…`` of some joints or all.

    Raises InputError with line and column: wrong or missing columns, text, NaN, time that does not increase, gaps.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header = _header(path, file.readline())
            if not any(line.strip() for line in file):
                raise InputError(str(path), "has no samples behind its header", "name another recording")
            table = _table(path, header)
    except UnicodeDecodeError as error:
        raise InputError(str(path), f"is not text ({error.reason})", "name a .csv or .mcap recording") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "check the path") from None
    t = table[:, 0]
    _check_time(path, t)

    def part(columns: list[int] | None) -> Array | None:
        return None if columns is None else np.ascontiguousarray(table[:, columns])

    notes = [f"no {quantity} columns" for quantity in QUANTITIES if header.columns(quantity) is None]
    wrench = part(header.wrench)
    return Recording(
        path=path,
        joints=header.joints,
        start_ns=0,
        t=np.ascontiguousarray(t),
        q=table[:, header.columns("q")],
        dq=part(header.columns("dq")),
        tau=part(header.columns("tau")),
        tau_motor=part(header.columns(MOTOR)),
        q_motor=_of_some(table, header, MOTOR_ANGLE),
        temperature=_of_some(table, header, TEMPERATURE),
        wrench_t=None if wrench is None else np.ascontiguousarray(t),
        wrench=wrench,
        notes=tuple(notes),
    )


def _of_some(table: Array, header: _Header, quantity: str) -> Array | None:
    """(samples, joints) of a quantity, NaN for a joint without."""
    own = header.some(quantity)
    if not own:
        return None
    result = np.full((len(table), len(header.joints)), np.nan)
    result[:, list(own)] = table[:, list(own.values())]
    return result


def _header(path: Path, line: str) -> _Header:
    place = f"{path}, line 1"
    expected = "the header is t,q_<joint>…,dq_<joint>…,tau_<joint>…[,fx,fy,fz,nx,ny,nz]"
    names = tuple(name.strip().strip('"') for name in line.strip().split(","))
    if not line.strip():
        raise InputError(str(path), "is empty", expected)
    if line.startswith(("#", "%", "//")):
        raise InputError(place, "is a comment", "leave it out: the first line is the header, t,q_<joint>…")
    if parted := _parted_by(line):
        remedy = "write commas between the columns, and points in the numbers"
        raise InputError(place, f"columns are parted by {parted}", remedy)
    if names[0] != "t":
        raise InputError(f"{place}, column 1", f"is {names[0]!r}, not 't'", expected)
    for number, name in enumerate(names, 1):
        if name in names[: number - 1]:
            raise InputError(f"{place}, column {number}", f"{name!r} is there twice", "remove one")
        if number > 1 and name not in WRENCH_COLUMNS and not re.fullmatch(r"(q|dq|tau|temperature)_.+", name):
            raise InputError(f"{place}, column {number}", f"{name!r} is no column of a recording", expected)
    angles = [name for name in names if name.startswith("q_")]
    joints = tuple(name[2:] for name in angles if f"q_{name.removeprefix(MOTOR_ANGLE + '_')}" not in angles)
    if not joints:
        raise InputError(place, "there is no column q_<joint>", expected)
    motors = {name for name in names if name.startswith(f"{MOTOR}_") and name.removeprefix("tau_") not in joints}
    for quantity, own in (("dq", set(names)), ("tau", set(names) - motors), (MOTOR, motors)):
        present = {name.removeprefix(f"{quantity}_") for name in own if name.startswith(f"{quantity}_")}
        _same_joints(place, quantity, joints, present)
    warm = {name.removeprefix(f"{TEMPERATURE}_") for name in names if name.startswith(f"{TEMPERATURE}_")}
    _same_joints(place, TEMPERATURE, tuple(joint for joint in joints if joint in warm), warm)
    missing = [name for name in WRENCH_COLUMNS if name not in names]
    if 0 < len(missing) < len(WRENCH_COLUMNS):
        raise InputError(place, f"the column {missing[0]!r} is missing", "give all six of the wrench, or none")
    return _Header(names, joints)


def _parted_by(line: str) -> str | None:
    """What parts the columns of a header that has no comma; None where it has some, or one column."""
    named = {";": "semicolons", "\t": "tabs", " ": "spaces"}
    text = line.strip()
    return None if "," in text else next((name for sign, name in named.items() if sign in text), None)


def _same_joints(place: str, quantity: str, joints: tuple[str, ...], present: set[str]) -> None:
    missing = [joint for joint in joints if joint not in present]
    if present and missing:
        remedy = f"give {quantity}_ for every joint, or for none"
        raise InputError(place, f"the column {quantity + '_' + missing[0]!r} is missing", remedy)
    if strange := sorted(present - set(joints)):
        name = f"{quantity}_{strange[0]}"
        raise InputError(place, f"{name!r} is there without 'q_{strange[0]}'", f"add it, or remove {name!r}")


def _table(path: Path, header: _Header) -> Array:
    """All numbers, samples × columns; the quick way, and on any trouble the way that finds its place."""
    try:
        table = np.loadtxt(path, delimiter=",", skiprows=1, comments=None, ndmin=2, encoding="utf-8-sig")
    except ValueError:
        raise _first_fault(path, header) from None
    if table.size and table.shape[1] == len(header.names) and np.isfinite(table).all():
        return np.asarray(table, dtype=np.float64)
    raise _first_fault(path, header)


def _first_fault(path: Path, header: _Header) -> InputError:
    """Where the file first leaves the format."""
    width = len(header.names)
    with path.open(encoding="utf-8-sig") as file:
        next(file)
        for line, text in enumerate(file, 2):
            fields = text.strip().split(",") if text.strip() else []
            if fields and len(fields) != width:
                what = f"has {len(fields)} fields, the header {width}"
                return InputError(f"{path}, line {line}", what, "the line may be cut off: repair or remove it")
            for column, field in enumerate(fields, 1):
                if not NUMBER.fullmatch(field.strip()):
                    place = f"{path}, line {line}, column {column} ({header.names[column - 1]})"
                    return InputError(place, f"{_shortened(field)} is not a number", "repair or remove the line")
    return InputError(str(path), "is not the table its header promises", "compare its lines with the header")


def _shortened(field: str) -> str:
    text = field.strip()
    return repr(text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…")


def _check_time(path: Path, t: Array) -> None:
    """InputError with the line of the first time that does not increase, or of the first gap."""
    wrong = np.flatnonzero(np.diff(t) <= 0)
    if len(wrong):
        k = int(wrong[0])
        raise InputError(
            f"{path}, line {_line_of_row(path, k + 1)}, column 1 (t)",
            f"time {t[k + 1]:.15g} does not come after {t[k]:.15g}",
            "sort the lines by time and remove repeated ones",
        )
    if gaps := find_gaps(t):
        gap = gaps[0]
        raise InputError(
            f"{path}, line {_line_of_row(path, gap.after + 1)}, column 1 (t)",
            f"a gap of {gap.duration:.4g} s where the samples are {np.median(np.diff(t)):.4g} s apart",
            "cut the file there and give the parts as recordings of their own",
        )


def _line_of_row(path: Path, row: int) -> int:
    """Line number of a sample, counting empty lines."""
    with path.open(encoding="utf-8-sig") as file:
        next(file)
        for line, text in enumerate(file, 2):
            if text.strip():
                if row == 0:
                    return line
                row -= 1
    raise IndexError(row)


class LeftOut(NamedTuple):
    """What of a recording a CSV file cannot hold: ``samples`` in which something is missing, and ``quantities`` that
    are missing in all of them."""

    samples: int
    quantities: tuple[str, ...]


def write_csv(recording: Recording, path: Path) -> LeftOut:
    """Write a recording in this format; returns what was left out.

    The wrench is interpolated to the joints' times. Numbers keep all their digits. Raises InputError.
    """
    names = ["t", *(f"q_{joint}" for joint in recording.joints)]
    columns = [recording.t[:, None], recording.q]
    nowhere = []
    for quantity, values in (("dq", recording.dq), ("tau", recording.tau), (MOTOR, recording.tau_motor)):
        if values is not None and np.isnan(values).all():
            nowhere.append(quantity)
        elif values is not None:
            names += [f"{quantity}_{joint}" for joint in recording.joints]
            columns.append(values)
    for quantity, of_some in ((MOTOR_ANGLE, recording.q_motor), (TEMPERATURE, recording.temperature)):
        if of_some is not None:
            told = np.flatnonzero(np.isfinite(of_some).any(axis=0))
            names += [f"{quantity}_{recording.joints[k]}" for k in told]
            columns.append(of_some[:, told])
    if recording.wrench is not None and recording.wrench_t is not None:
        wrench = wrench_at(recording.t, recording.wrench_t, recording.wrench)
        if np.isnan(wrench).all():
            nowhere.append("wrench")
        else:
            names += WRENCH_COLUMNS
            columns.append(wrench)
    table = np.hstack(columns)
    whole = np.isfinite(table).all(axis=1)
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(",".join(names) + "\n")
            for row in table[whole].tolist():
                file.write(",".join(map(repr, row)) + "\n")
    except FileExistsError:
        raise InputError(str(path), "is already there", "choose another name; nothing was overwritten") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror})", "check the directory") from None
    return LeftOut(int(np.count_nonzero(~whole)), tuple(nowhere))


def wrench_at(t: Array, wrench_t: Array, wrench: Array) -> Array:
    """The wrench at times ``t``, between neighbouring good samples; NaN outside of them and across a gap."""
    good = np.isfinite(wrench).all(axis=1)
    times, values = wrench_t[good], wrench[good]
    if len(times) < 2:
        return np.full((len(t), len(WRENCH_COLUMNS)), np.nan)
    after = np.clip(np.searchsorted(times, t), 1, len(times) - 1)
    step = times[after] - times[after - 1]
    share = np.where(step > 0, (t - times[after - 1]) / np.where(step > 0, step, 1.0), 0.0)
    result: Array = values[after - 1] + share[:, None] * (values[after] - values[after - 1])
    usual = float(np.median(np.diff(times)))
    result[(t < times[0]) | (t > times[-1]) | (step > 3.5 * usual)] = np.nan
    return result
