"""What the loop tells about itself, as plain data."""

from __future__ import annotations

from dataclasses import dataclass

from config.schema import Mode
from driver.cyclic.cycle import LoopState

LATENESS_EDGES_US = (10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000)
"""Upper edges of the histogram of wake-up lateness, µs; one more bin holds what is above the last."""


@dataclass(frozen=True)
class RealtimeReport:
    """What of real-time operation the system granted, and sentences for what it refused, with the remedy."""

    scheduling: str
    """"fifo 80", or "normal"."""
    memory_locked: bool
    timer_slack_ns: int
    refused: tuple[str, ...]


@dataclass(frozen=True)
class BusStatus:
    """One bus: frames that passed in each direction, ``load`` (share of bit time over the last second), errors seen."""

    name: str
    frames_sent: int
    frames_received: int
    load: float
    errors: int


@dataclass(frozen=True)
class SensorStatus:
    """One wrench sensor: valid samples, rejected bytes or frames, age of the newest valid sample (None before one), and
    in words how it is."""

    name: str
    samples: int
    rejected: int
    age_ms: float | None
    stale: bool
    condition: str


@dataclass(frozen=True)
class LoopStatus:
    """The loop at one moment. Tuples are one entry a joint; measured values are NaN where feedback is missing."""

    state: LoopState
    mode: Mode | None
    """Operating mode the drives are commissioned for."""
    cause: str | None
    """Why the arm was stopped, while latched or stopping; one sentence."""
    time_ns: int
    q_d: tuple[float, ...]
    """Position last commanded, rad: where the arm is told to hold. With the drives off it follows the measured one."""
    q: tuple[float, ...]
    dq: tuple[float, ...]
    tau: tuple[float, ...]
    valid: tuple[bool, ...]
    drive_states: tuple[str, ...]
    run: int
    """Number of the run being played, else 0."""
    last_run: int
    """Number of the newest run, ended or not."""
    progress: float
    """Share of the newest run that has been played, 0 to 1."""
    run_outcome: str | None
    """None while the newest run is played; "done", or the sentence for what ended it."""
    cycles: int
    good_cycles: int
    """Watchdog counter: cycles that began on time and whose command the gate let through. Feed a watchdog only when
    it advances; it stands in lockstep whenever virtual time does."""
    missed: int
    """Deadlines missed: cycles skipped, late beyond a quarter of the period, or incomplete."""
    lateness_us: tuple[int, ...]
    """Counts by `LATENESS_EDGES_US`."""
    lateness_max_us: float
    cpu_us: float
    """CPU of the loop's process a cycle, mean since the last status."""
    lockstep: bool
    realtime: RealtimeReport
    buses: tuple[BusStatus, ...]
    sensors: tuple[SensorStatus, ...]
    last_frames: tuple[str, ...]
    """What passed on every bus and serial line before the latched fault, a line each: time, bus, direction, id, bytes;
    time, sensor, bytes."""
