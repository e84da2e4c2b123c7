"""`Recording`: a run as arrays, whoever recorded it."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation

Array = NDArray[np.float64]
GAP_STEPS = 10
"""A step this many times the usual one is a gap: more than jitter explains."""


@dataclass(frozen=True)
class Event:
    """One sentence of /events, ``t`` s after the recording's start; ``level`` 20 says, 30 warns, 40 is an error."""

    t: float
    level: int
    text: str


@dataclass(frozen=True)
class Gap:
    """Nothing was recorded between samples ``after`` and ``after + 1``, for ``duration`` s from ``t`` on."""

    after: int
    t: float
    duration: float


@dataclass(frozen=True)
class Recording:
    """Joint-space arrays are samples × joints, float64, in SI units; a quantity that the file lacks is None.

    In our own recordings a sample that did not arrive is NaN. A foreign file with NaN is refused when it is read.
    """

    path: Path
    joints: tuple[str, ...]
    start_ns: int
    """Time of the first sample: since 1970 where the file says so, else 0."""
    t: Array
    """s since ``start_ns``, strictly increasing."""
    q: Array
    dq: Array | None
    tau: Array | None
    q_d: Array | None = None
    dq_d: Array | None = None
    tau_command: Array | None = None
    tau_ff: Array | None = None
    wrench_t: Array | None = None
    """Samples of the first wrench sensor have times of their own, s since ``start_ns``."""
    wrench: Array | None = None
    """samples × (fx, fy, fz, nx, ny, nz), N and N·m, in ``wrench_frame``."""
    wrench_frame: str | None = None
    events: tuple[Event, ...] = ()
    arm: str | None = None
    installation: Installation | None = None
    """What the recording was made with; None in foreign files."""
    metadata: dict[str, str] = field(default_factory=dict)
    gaps: tuple[Gap, ...] = ()
    notes: tuple[str, ...] = ()
    """What a reader should be told: gaps, ignored messages, absent channels."""
    tau_motor: Array | None = None
    """N·m at the joint by the motor's current, where ``tau`` is that of a sensor behind the gear."""
    q_motor: Array | None = None
    """rad at the joint by the motor's encoder, where ``q`` is that of one behind the gear; NaN of joints without."""
    temperature: Array | None = None
    """°C of each joint's motor or gear; NaN of joints without."""

    @property
    def period(self) -> float:
        """The usual step between samples, s (median)."""
        return float(np.median(np.diff(self.t)))

    @property
    def segments(self) -> tuple[slice, ...]:
        """Rows without a gap inside; nothing may be filtered or differentiated across their bounds."""
        bounds = [0, *(gap.after + 1 for gap in self.gaps), len(self.t)]
        return tuple(slice(first, last) for first, last in pairwise(bounds))


def check_increasing(time_ns: NDArray[np.int64], place: str) -> None:
    """InputError when a time does not come after the one before; ``place`` says what is counted."""
    wrong = np.flatnonzero(np.diff(time_ns) <= 0)
    if len(wrong):
        row = int(wrong[0]) + 1
        since = (time_ns[row - 1 : row + 1] - time_ns[0]) / 1e9
        raise InputError(
            f"{place} {row + 1}",
            f"time {since[1]:.9g} s does not come after {since[0]:.9g} s",
            "sort the recording by time and remove repeated samples",
        )


def find_gaps(t: Array) -> tuple[Gap, ...]:
    """Steps of more than `GAP_STEPS` times the median step."""
    if len(t) < 3:
        return ()
    steps = np.diff(t)
    after = np.flatnonzero(steps > GAP_STEPS * np.median(steps))
    return tuple(Gap(int(k), float(t[k]), float(steps[k])) for k in after)


def gap_notes(gaps: tuple[Gap, ...]) -> list[str]:
    """One sentence for all gaps; none without."""
    if not gaps:
        return []
    longest = max(gaps, key=lambda gap: gap.duration)
    count = "1 gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
    return [
        f"{count}, together {sum(gap.duration for gap in gaps):.3g} s: "
        f"the longest {longest.duration:.3g} s, at t = {longest.t:.6g} s"
    ]
