"""From recordings to trials: the samples of the motion, in time with the reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config import InputError
from config.schema import Mode
from driver.recording import Recording
from learner.cosine_spectrum import frequencies, low_pass, to_lines
from learner.feedback_loop import FeedbackLoop
from learner.trial import Reference, Timing, Trial
from service.practice.planning import command_delay

Array = NDArray[np.float64]
SAME_RAD = 1e-6
LOOKED_AT = 64
"""Samples of the motion by which it is found in a recording."""
LONGEST_LAG, LAG_STEP = 8.0, 0.125
"""Cycles."""
LAG_BAND_HZ = 30.0
"""Above it the velocity's noise, which every tick of the servo sees anew, hides what was demanded."""


LONGEST_GAP = 3
"""Cycles: a straight line over so few is nearer to the truth than the sensors' noise."""


@dataclass(frozen=True)
class ActuationLag:
    """Cycles from the drive's demand to the torque it measures, (n,); ``residual``: (n,) N·m RMS that stay unexplained.

    By it feedforward has to be sent ahead, and above about a sixth of its inverse what is not known of it spoils.
    """

    cycles: Array
    residual: Array


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

    Feedback that did not arrive for up to `LONGEST_GAP` cycles is bridged by a straight line.
    Raises InputError when the motion is not whole, or more is missing in it.
    """
    start = begin_of(recording, reference, name) + delay
    rows = slice(start, start + reference.samples)
    assert recording.dq is not None
    assert recording.tau is not None
    trial = Trial(*(_bridged(channel[rows]) for channel in (recording.q, recording.dq, recording.tau)))
    trial.check(reference, name)
    return trial


def as_demanded(
    trial: Trial,
    recording: Recording,
    reference: Reference,
    loop: FeedbackLoop,
    mode: Mode,
    cycles: Array,
    joints: NDArray[np.bool_],
) -> Trial:
    """The trial with the torque that was demanded of ``joints`` (n,), ``cycles`` (n,) later, when it acts, in place of
    the measured one.

    For drives that measure no velocity: their damping acts on differences of counts, tick by tick. That chatter moves
    nothing, but samples of the torque show it as if it were slow, the same in all replays of one command and another
    in each trial. What was sent, and the servo's law on the angles' errors, is free of it.
    """
    assert recording.tau_command is not None
    start = begin_of(recording, reference, str(recording.path))
    demand = _bridged(recording.tau_command[start : start + reference.samples])
    if mode == "csp":
        demand = demand + loop.stiffness * (reference.q - trial.q) + loop.damping * (reference.dq - trial.dq)
    later = Timing(held=True, advance=-cycles).command(demand)
    return replace(trial, tau=np.where(joints, later, trial.tau))


def _bridged(channel: Array) -> Array:
    """A channel (samples × n) with its short gaps filled; longer ones stay NaN."""
    missing = np.isnan(channel)
    if not missing.any():
        return channel
    result = channel.copy()
    at = np.arange(len(channel))
    for column, gone in zip(result.T, missing.T, strict=True):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], gone.astype(int), [0]])))
        for first, end in edges.reshape(-1, 2):
            if end - first <= LONGEST_GAP and first > 0 and end < len(column):
                column[first:end] = np.interp(at[first:end], [first - 1, end], [column[first - 1], column[end]])
    return result


def actuation_lag(
    recordings: Sequence[Recording], loop: FeedbackLoop, reference: Reference, mode: Mode
) -> ActuationLag:
    """By what shift the measured torque is explained by what was demanded, below `LAG_BAND_HZ`.

    CSP: by the torque offset and the servo's law with its configured gains; CST: by the commanded torque.
    """
    shifts = np.arange(0.0, LONGEST_LAG, LAG_STEP)
    found = low_pass(frequencies(reference.samples, reference.period), LAG_BAND_HZ)[:, None]
    power = np.zeros((len(shifts), reference.n))
    for recording in recordings:
        start = begin_of(recording, reference, str(recording.path)) + command_delay(mode)
        rows = np.arange(start, start + reference.samples)
        for k, shift in enumerate(shifts):
            off = _bridged(_unexplained(recording, rows, float(shift), loop, mode))
            lines = found * to_lines(off)
            power[k] += np.mean(lines**2, axis=0) / len(recordings)
    best = np.argmin(power, axis=0)
    return ActuationLag(shifts[best], np.sqrt(power[best, np.arange(reference.n)]))


def _unexplained(recording: Recording, rows: NDArray[np.intp], shift: float, loop: FeedbackLoop, mode: Mode) -> Array:
    whole, part = int(shift), shift % 1.0

    def earlier(channel: Array | None, delay: int = 0) -> Array:
        assert channel is not None
        at = rows - whole - delay
        return (1.0 - part) * channel[at] + part * channel[at - 1]

    assert recording.tau is not None
    delay = command_delay(mode)
    off = recording.tau[rows] - earlier(recording.tau_command, delay)
    if mode == "csp":
        off -= loop.stiffness * (earlier(recording.q_d, delay) - earlier(recording.q))
        off -= loop.damping * (earlier(recording.dq_d, delay) - earlier(recording.dq))
    return np.asarray(off)
