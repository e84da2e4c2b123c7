"""From recordings to trials: the samples of the motion, in time with the reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from config.schema import Mode
from driver.recording import Recording
from learner.feedback_loop import FeedbackLoop
from learner.trial import Reference, Trial

Array = NDArray[np.float64]
SAME_RAD = 1e-6
LOOKED_AT = 64
"""Samples of the motion by which it is found in a recording."""
LONGEST_LATENCY = 6.0
"""Cycles."""


@dataclass(frozen=True)
class Latency:
    """Cycles from a command to its effect, identified; ``residual``: N·m RMS of what the servo's law leaves."""

    cycles: float
    residual: float


def begin_of(recording: Recording, reference: Reference, name: str) -> int:
    """The cycle in which the reference's first sample was commanded.

    Raises InputError when the recording does not hold the whole motion.
    """
    if recording.q_d is None or recording.tau is None or recording.dq is None:
        raise InputError(name, "has no commanded position or measured torque", "give a recording of etude's own")
    commanded = recording.q_d
    last = len(commanded) - reference.samples
    if last >= 0:
        at = np.linspace(0, reference.samples - 1, LOOKED_AT).astype(int)
        starts = np.arange(last + 1)
        off = np.abs(commanded[starts[:, None] + at] - reference.q[at]).max(axis=(1, 2))
        best = int(np.nanargmin(off)) if np.isfinite(off).any() else 0
        if off[best] < SAME_RAD:
            return best
    raise InputError(name, "does not hold the whole motion", "repeat a trial that was cut short")


def trial_of(recording: Recording, reference: Reference, delay: int, name: str) -> Trial:
    """What was measured ``delay`` cycles after each sample of the reference was commanded.

    Raises InputError when the motion is not whole, or feedback is missing in it.
    """
    start = begin_of(recording, reference, name) + delay
    rows = slice(start, start + reference.samples)
    assert recording.dq is not None
    assert recording.tau is not None
    trial = Trial(recording.q[rows], recording.dq[rows], recording.tau[rows])
    trial.check(reference, name)
    return trial


def servo_latency(recordings: Sequence[Recording], loop: FeedbackLoop, reference: Reference, mode: Mode) -> Latency:
    """By what shift the measured torque is explained by what was commanded.

    CSP: the servo's law with its configured gains, on references that many cycles old; CST: the commanded torque.
    A fraction of a cycle is found by interpolation.
    """
    best = Latency(np.nan, np.inf)
    for shift in np.arange(0.0, LONGEST_LATENCY, 0.05):
        squares, count = 0.0, 0
        for recording in recordings:
            start = begin_of(recording, reference, str(recording.path))
            rows = np.arange(start + int(LONGEST_LATENCY) + 1, start + reference.samples)
            off = _unexplained(recording, rows, shift, loop, mode)
            off = off[np.isfinite(off).all(axis=1)] / loop.damping
            squares, count = squares + float(np.sum(off**2)), count + off.size
        residual = float(np.sqrt(squares / max(1, count)))
        if residual < best.residual:
            best = Latency(float(shift), residual)
    return best


def _unexplained(recording: Recording, rows: NDArray[np.intp], shift: float, loop: FeedbackLoop, mode: Mode) -> Array:
    whole, part = int(shift), shift % 1.0

    def earlier(channel: Array | None) -> Array:
        assert channel is not None
        return (1.0 - part) * channel[rows - whole] + part * channel[rows - whole - 1]

    assert recording.tau is not None
    assert recording.dq is not None
    tau = recording.tau[rows]
    if mode == "cst":
        return np.asarray(tau - earlier(recording.tau_command))
    feedback = loop.stiffness * (earlier(recording.q_d) - recording.q[rows])
    feedback += loop.damping * (earlier(recording.dq_d) - recording.dq[rows])
    return np.asarray(tau - earlier(recording.tau_command) - feedback)
