"""Velocity sensors made consistent with the angles, as the thesis had to (Section 6.4).

A tachometer that reads two percent high would have the feedback pull against itself, and learning chase a motion that
angles and velocities do not share. Gain and offset come from the replays, whose angles say how far the arm went.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from learner.cosine_spectrum import frequencies, low_pass, to_history, to_lines
from learner.trial import Reference, Trial

Array = NDArray[np.float64]
FALSE_ALARM = 1e-3
"""Probability that a gain or offset is believed where there is none."""
PHASES = 8
"""Places within a count from which a motion is read: any of them is as likely."""


def from_angles(trial: Trial, reference: Reference, joints: NDArray[np.bool_], band_hz: float) -> Trial:
    """The trial with velocities of ``joints`` (n,) by their angles: how the angle's error changes, up to ``band_hz``.

    For drives that measure no velocity. A difference of two samples of an encoder is half a sample late, and a count
    divided by the period; both would be taken for errors of the motion.
    """
    if not joints.any():
        return trial
    passed = low_pass(frequencies(reference.samples, reference.period), band_hz)[:, None]
    error = to_history(passed * to_lines(trial.q - reference.q))
    return replace(trial, dq=np.where(joints, reference.dq + np.gradient(error, reference.period, axis=0), trial.dq))


def as_read(reference: Reference, count_rad: Array, joints: NDArray[np.bool_], band_hz: float) -> list[Trial]:
    """The wanted motion itself, as encoders of ``count_rad`` (n,) would tell it at ``joints``: see `from_angles`.

    Replays of one command read the same counts at the same places, so that their scatter does not show the error of
    counting; a better command reads others.
    """
    trials = []
    for phase in np.arange(PHASES) / PHASES:
        counted = count_rad * (np.round(reference.q / count_rad + phase) - phase)
        q = np.where(joints, counted, reference.q)
        trials.append(from_angles(Trial(q, reference.dq, np.zeros_like(q)), reference, joints, band_hz))
    return trials


@dataclass(frozen=True)
class VelocityCalibration:
    """measured = gain · true + offset; (n,) each, rad/s the offset."""

    gain: Array
    offset: Array

    def apply(self, trial: Trial) -> Trial:
        """The trial with velocities as the angles have them."""
        return replace(trial, dq=(trial.dq - self.offset) / self.gain)


def calibrate(replays: Sequence[Trial], reference: Reference) -> VelocityCalibration:
    """From how far the angles and the summed velocities went, over all replays.

    What cannot be told from 1 and 0 is taken as such. Sums of velocities carry little noise, and no differentiation
    is needed: q[k] − q[0] = gain⁻¹·∫(dq − offset)dt.
    """
    n, h = reference.n, reference.period
    significant = float(student.isf(FALSE_ALARM / 2.0, len(replays) - 1))
    gain, offset = np.ones(n), np.zeros(n)
    t = np.arange(reference.samples) * h
    for joint in range(n):
        columns, gone = [], []
        for trial in replays:
            q = trial.q[:, joint]
            columns.append(np.column_stack([q - q[0], t, np.ones_like(t)]))
            dq = trial.dq[:, joint]
            gone.append(np.concatenate([[0.0], np.cumsum((dq[1:] + dq[:-1]) * h / 2.0)]))
        found = np.array([np.linalg.lstsq(c, g, rcond=None)[0][:2] for c, g in zip(columns, gone, strict=True)])
        mean, error = found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(len(found))
        if np.ptp(reference.q[:, joint]) > 0.0 and abs(mean[0] - 1.0) > significant * error[0]:
            gain[joint] = mean[0]
        if abs(mean[1]) > significant * error[1]:
            offset[joint] = mean[1]
    return VelocityCalibration(gain, offset)
