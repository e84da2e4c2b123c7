"""One cycle of the loop as the rest of the house sees it, and the states of the loop."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple


class LoopState(IntEnum):
    """What the loop is doing. `LATCHED` needs an explicit reset."""

    COMMISSIONING = 0
    IDLE = 1
    """SYNC runs, feedback is read, drives are not enabled."""
    ENABLING = 2
    HOLDING = 3
    """Drives enabled, the arm holds where it is."""
    PLAYING = 4
    STOPPING = 5
    """Damped stop with gravity compensation, or drive-side quick stop."""
    LATCHED = 6
    """Stopped on a fault; the cause is kept until it is acknowledged."""


class WrenchSample(NamedTuple):
    """Force and torque in the sensor's frame, N and N·m; ``fresh`` is False when nothing valid came this cycle."""

    values: tuple[float, float, float, float, float, float]
    status: int
    stamp_ns: int
    fresh: bool


class RawFrame(NamedTuple):
    """One CAN frame as it passed the wire: 16 bytes of struct can_frame. ``sent`` by the host, or received."""

    bus: int
    time_ns: int
    sent: bool
    data: bytes


@dataclass(frozen=True, slots=True)
class Cycle:
    """One cycle. Tuples have one entry a joint, in the installation's order; SI at the joint.

    ``time_ns`` is the SYNC's instant, at which the drives sampled. ``valid[i]`` is False when joint i's
    feedback did not arrive: its measured values are then NaN, never repeated.
    """

    index: int
    time_ns: int
    state: LoopState
    late_ns: int
    valid: tuple[bool, ...]
    q: tuple[float, ...]
    dq: tuple[float, ...]
    tau: tuple[float, ...]
    q_d: tuple[float, ...]
    dq_d: tuple[float, ...]
    tau_command: tuple[float, ...]
    """Torque really sent: target torque (CST), torque offset (CSP)."""
    tau_ff: tuple[float, ...]
    """The model's feedforward of the motion being played."""
    run: int
    """Number of the run being played, 0 when none is."""
    wrench: WrenchSample | None
    frames: tuple[RawFrame, ...]
    serial: tuple[tuple[int, bytes], ...]
    """Bytes of each sensor's line since the last cycle: (sensor number, bytes)."""
    events: tuple[str, ...]
    """Sentences for /events: state changes with causes, emergencies, missed deadlines."""
