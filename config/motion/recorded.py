"""A path in joint space from a table of angles."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.motion.curves import Array
from config.toml_file import nearest, shown

_FEWEST_ROWS = 16
_ORDER = 2
"""Of the Butterworth low-pass; run both ways, so that it acts with twice this order and no delay."""


def read_path(path: Path, joints: Sequence[str], cutoff_hz: float | None) -> tuple[Array, Array]:
    """Times from 0 [s] and angles (samples × joints, rad) of a CSV file with the columns ``t`` and ``q_<joint>``.

    Other columns are left aside. With ``cutoff_hz`` the angles pass a zero-phase low-pass, on even times.
    Raises InputError with line and column for a missing column, an entry that is no finite number, or time that
    does not rise.
    """
    place = shown(path)
    try:
        with path.open(encoding="utf-8", newline="") as lines:
            rows = list(csv.reader(lines))
    except OSError as error:
        raise InputError(place, f"cannot be read ({error.strerror})", "check the motion's key 'file'") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(place, f"is not a CSV text ({error})", "give t,q_<joint>… in s and rad") from None
    header = [name.strip() for name in rows[0]] if rows else []
    wanted = ["t", *(f"q_{joint}" for joint in joints)]
    for name in wanted:
        if name not in header:
            raise InputError(f"{place}, line 1", f"there is no column {name!r}", nearest(name, header))
    columns = [header.index(name) for name in wanted]
    table = np.array([_numbers(row, columns, header, f"{place}, line {k}") for k, row in enumerate(rows[1:], 2) if row])
    if len(table) < _FEWEST_ROWS:
        raise InputError(place, f"has {len(table)} samples", f"give at least {_FEWEST_ROWS}")
    t, q = table[:, 0] - table[0, 0], table[:, 1:]
    if (falls := np.flatnonzero(np.diff(t) <= 0)).size:
        raise InputError(f"{place}, line {falls[0] + 3}, column 't'", "time does not rise", "remove or mend that row")
    return (t, q) if cutoff_hz is None else _smoothed(t, q, cutoff_hz, place)


def _numbers(row: Sequence[str], columns: Sequence[int], header: Sequence[str], place: str) -> list[float]:
    if len(row) != len(header):
        raise InputError(place, f"has {len(row)} columns where the header has {len(header)}", "mend that row")
    values = []
    for column in columns:
        try:
            value = float(row[column])
        except ValueError:
            value = np.nan
        if not np.isfinite(value):
            raise InputError(
                f"{place}, column {header[column]!r}", f"{row[column]!r} is no finite number", "mend that entry"
            )
        values.append(value)
    return values


def _smoothed(t: Array, q: Array, cutoff_hz: float, place: str) -> tuple[Array, Array]:
    from scipy.signal import butter, sosfiltfilt  # half a second to load, needed by few

    rate_hz = (len(t) - 1) / t[-1]
    if cutoff_hz >= rate_hz / 2:
        raise InputError(
            place, f"has {rate_hz:.4g} samples a second, too few for cutoff_hz = {cutoff_hz:g}", "lower cutoff_hz"
        )
    even = np.linspace(0.0, t[-1], len(t))
    angles = np.column_stack([np.interp(even, t, column) for column in q.T])
    low_pass = butter(_ORDER, cutoff_hz, fs=rate_hz, output="sos")
    return even, np.asarray(sosfiltfilt(low_pass, angles, axis=0))
