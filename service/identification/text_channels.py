"""A recording as one plain text file a channel, as published with C. Gaz et al., "Dynamic Identification of the
Franka Emika Panda Robot" (IEEE RA-L 4(4), 2019): ``*_time.txt`` [s], ``*_positions.txt`` [rad], ``*_velocity.txt``
[rad/s], ``*_torques.txt`` [N·m], one number a line, the joints of one sample behind one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError
from driver.recording import Recording

Array = NDArray[np.float64]


def is_text_channels(path: Path) -> bool:
    """Whether ``path`` is a directory with such a set of files."""
    return path.is_dir() and any(path.glob("*_positions.txt"))


def read_text_channels(directory: Path, joints: Sequence[str]) -> Recording:
    """The set as a recording of ``joints``, in their order.

    Raises InputError naming file and line for a missing file, text that is no number, a count that does not divide
    into samples, or time that does not rise.
    """
    n = len(joints)
    t = _numbers(directory, "time")
    channels = {name: _numbers(directory, name) for name in ("positions", "velocity", "torques")}
    for name, values in channels.items():
        if values.size != n * t.size:
            raise InputError(
                str(_file(directory, name)),
                f"has {values.size} numbers for {t.size} samples of {n} joints",
                f"there should be {n * t.size}, one a line",
            )
    fallen = np.flatnonzero(np.diff(t) <= 0.0)
    if fallen.size:
        raise InputError(
            str(_file(directory, "time")),
            f"line {fallen[0] + 2}: time does not rise ({t[fallen[0]]:.6f} s, then {t[fallen[0] + 1]:.6f} s)",
            "sort the samples or cut the recording there",
        )
    return Recording(
        path=directory,
        start_ns=0,
        t=t - t[0],
        joints=tuple(joints),
        q=channels["positions"].reshape(-1, n),
        dq=channels["velocity"].reshape(-1, n),
        tau=channels["torques"].reshape(-1, n),
    )


def _file(directory: Path, channel: str) -> Path:
    found = sorted(directory.glob(f"*_{channel}.txt"))
    if len(found) != 1:
        raise InputError(
            str(directory), f"has {len(found)} files *_{channel}.txt", "a set of text channels has exactly one of each"
        )
    return found[0]


def _numbers(directory: Path, channel: str) -> Array:
    path = _file(directory, channel)
    try:
        values = np.array(path.read_text().split(), dtype=float)
    except (ValueError, UnicodeDecodeError):
        raise InputError(str(path), f"line {_bad_line(path)} is no number", "write one number a line") from None
    unfit = np.flatnonzero(~np.isfinite(values))
    if unfit.size:
        raise InputError(str(path), f"number {unfit[0] + 1} is {values[unfit[0]]}", "write finite numbers only")
    return values


def _bad_line(path: Path) -> int:
    for number, line in enumerate(path.read_bytes().splitlines(), 1):
        try:
            [float(word) for word in line.split()]
        except ValueError:
            return number
    return 0
