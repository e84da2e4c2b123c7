"""Practice: from the model's feedforward, trial by trial, to the arm's repeatability (Section 6.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from config import InputError
from learner.certificate import Certificate, spread_moving
from learner.changes import Change, ChangeWatch
from learner.constrained import TorqueLimits, constrained
from learner.cosine_spectrum import frequencies, low_pass, smoothed_power, to_history, to_lines
from learner.feedback_loop import FeedbackLoop
from learner.inverse_model import InverseModel
from learner.kinematics import Kinematics
from learner.linearisation import LinearArm, linearise
from learner.operators import LearningOperator
from learner.repeatability import Repeatability, repeatability
from learner.rests import moving_weight, slow_share, speed_weight
from learner.trial import Reference, Timing, Trial
from learner.trial_filter import Surprise, TrialFilter, noise_of

Array = NDArray[np.float64]
DISAGREEMENT = 1.5
"""Observed error over the predicted one, from which on the model is said to lack something."""
INSTANTS = 16


@dataclass(frozen=True)
class Task:
    """What is practised, and with what. ``base``: the model's torque for the reference, in time with a trial's."""

    reference: Reference
    base: Array
    operator: LearningOperator
    certificate: Certificate
    loop: FeedbackLoop
    timing: Timing
    limits: TorqueLimits
    arm: LinearArm
    """Along the motion: predicts what a command error does."""


@dataclass(frozen=True)
class Lesson:
    """One trial, and what was made of it; (n,) each."""

    velocity_error_rms: Array
    position_error_peak: Array
    predicted_rms: Array
    """rad/s, made before the trial; NaN for the first."""
    findings: tuple[str, ...]
    learnt: bool
    """False when the trial told of a changed arm."""
    at_repeatability: bool
    slow_share: Array
    """Of the velocity error's power, what lies where the joint is slow (`learner.rests.SLOW_SHARE`)."""


class Update(Protocol):
    """Makes the next correction of what trials show to be needed."""

    @property
    def correction(self) -> Array: ...

    @property
    def variance(self) -> Array: ...

    def expect(self, measured: Array, repeats: int = 1) -> Surprise: ...

    def take(self, measured: Array, repeats: int = 1) -> None: ...


class GainOne:
    """The last trial's correction, low-passed: Eq. 6.11 as the thesis did it."""

    def __init__(self, frequency: Array, noise: Array, band_hz: float) -> None:
        self._pass = low_pass(frequency, band_hz)[:, None]
        self._lines = np.zeros_like(noise)
        self.variance = self._pass**2 * noise
        self._noise = noise

    @property
    def correction(self) -> Array:
        return to_history(self._pass * self._lines)

    def expect(self, measured: Array, repeats: int = 1) -> Surprise:
        return Surprise(to_lines(measured) - self._lines, (1.0 + 1.0 / repeats) * self._noise)

    def take(self, measured: Array, repeats: int = 1) -> None:
        self._lines = to_lines(measured)


def prepare(
    model: InverseModel,
    momentary: InverseModel,
    reference: Reference,
    kinematics: Kinematics,
    operator: LearningOperator,
    certificate: Certificate,
    loop: FeedbackLoop,
    timing: Timing,
    limits: TorqueLimits,
) -> Task:
    """Initialise the feedforward by the model (Eq. 6.1); ``momentary``: as in `ModelOperator`.

    Raises InputError when the operator is refused.
    """
    if not certificate.admitted:
        raise InputError(f"operator {operator.name}", certificate.reason, "choose another operator or a slower motion")
    exact = Kinematics(reference.period, held=kinematics.held, flat_hz=None)
    q, dq, ddq = exact.at_torques(reference.q, reference.dq)
    if not kinematics.held:
        ddq = reference.ddq
    at = spread_moving(reference, INSTANTS)
    arm = linearise(momentary, reference.q[at], reference.dq[at], reference.ddq[at])
    return Task(reference, model.torque(q, dq, ddq), operator, certificate, loop, timing, limits, arm)


class Practice:
    """Learns from the replays, then from one trial after another.

    ``hand_picked_hz``: the low-pass of the thesis' own update (8 Hz there) in place of the trial filter. ``as_read``:
    the wanted motion as the arm's encoders would tell it, see `learner.velocity_sensor.as_read`.
    Raises InputError when there are too few replays, or one is cut short.
    """

    def __init__(
        self,
        task: Task,
        replays: Sequence[Trial],
        hand_picked_hz: float | None = None,
        as_read: Sequence[Trial] = (),
    ) -> None:
        self.task = task
        reference = task.reference
        self.repeatability: Repeatability = repeatability(replays, reference, as_read)
        self._frequency = frequencies(reference.samples, reference.period)
        measured = np.array([self._needed(trial) for trial in replays])
        scatter, counting = noise_of(measured), np.zeros_like(task.base)
        if as_read:
            counted = [to_lines(task.operator.command_error(trial, reference)) ** 2 for trial in as_read]
            counting = smoothed_power(np.mean(counted, axis=0))
        band = task.certificate.band_hz
        self.update: Update
        if hand_picked_hz is None:
            self.update = TrialFilter(self._frequency, scatter, band, counting)
            first, repeats = measured.mean(axis=0), len(replays)
        else:
            # One trial is all that this update ever looks at.
            self.update = GainOne(self._frequency, scatter + counting, min(hand_picked_hz, band))
            first, repeats = measured[-1], 1
        self._telling = moving_weight(reference)
        self._in_motion = speed_weight(reference)
        self._lacked = self.update.expect(first, repeats)
        self.update.take(first, repeats)
        self._watch = ChangeWatch(self._frequency, len(replays), band, to_lines(self.update.correction))
        self._applied = np.zeros_like(task.base)
        self._response = self._velocity_response()
        self._predicted = np.full(reference.n, np.nan)
        self.changed_in_a_row = 0
        self.near_in_a_row = 0
        rms = np.sqrt(np.mean([t.velocity_error_rms(reference) ** 2 for t in replays], axis=0))
        peak = np.max([t.position_error_peak(reference) for t in replays], axis=0)
        self.lessons: list[Lesson] = [
            Lesson(rms, peak, self._predicted, (), True, self._near(rms), slow_share(replays, reference))
        ]
        self._renew()

    @property
    def torque(self) -> Array:
        """Feedforward of the next trial (samples × n, N·m), in time with a trial's torque."""
        return self._torque

    @property
    def command(self) -> Array:
        """The same as it is sent, ahead of its action by the timing's advance."""
        return self.task.timing.command(self._torque)

    @property
    def best(self) -> int:
        """Of the lessons the one with the least error, of the joint that is farthest from its repeatability; the
        replays are lesson 0."""
        ratios = [(lesson.velocity_error_rms / self.repeatability.velocity).max() for lesson in self.lessons]
        return int(np.argmin(ratios))

    def left(self, names: Sequence[str]) -> tuple[str, ...]:
        """Each joint whose last error can be told from repeatability: times it, and where the error lies."""
        last = self.lessons[-1]
        ratio = last.velocity_error_rms / self.repeatability.velocity
        return tuple(
            f"{name} {ratio[i]:.2f} × ({100.0 * last.slow_share[i]:.0f} %)"
            for i, name in enumerate(names)
            if last.velocity_error_rms[i] > self.repeatability.bound[i]
        )

    def take(self, trial: Trial, names: Sequence[str]) -> Lesson:
        """Learn from one trial of the present feedforward; ``names`` of the joints, for sentences.

        Raises InputError when the trial is not whole: nothing is learnt from it.
        """
        reference = self.task.reference
        trial.check(reference)
        needed = self._needed(trial)
        # At rest friction holds within its level whatever is commanded: a torque measured there is no news.
        expected = self.update.correction
        needed = self._telling * needed + (1.0 - self._telling) * expected
        change = self._watch.look(self.update.expect(self._in_motion * needed + (1.0 - self._in_motion) * expected))
        rms = trial.velocity_error_rms(reference)
        learnt = not change.changed.any()
        findings = self._findings(rms, change, names)
        self.changed_in_a_row = 0 if learnt else self.changed_in_a_row + 1
        near = self._near(rms)
        self.near_in_a_row = self.near_in_a_row + 1 if near else 0
        peak, slow = trial.position_error_peak(reference), slow_share([trial], reference)
        lesson = Lesson(rms, peak, self._predicted, findings, learnt, near, slow)
        self.lessons.append(lesson)
        if learnt:
            self.update.take(needed)
            self._renew()
        return lesson

    def _needed(self, trial: Trial) -> Array:
        """uⁱ − δûⁱ beyond the model's torque: what Eq. 6.11 would add to it."""
        task = self.task
        return np.asarray(trial.tau - task.operator.command_error(trial, task.reference) - task.base)

    def _near(self, rms: Array) -> bool:
        return bool((rms <= self.repeatability.bound).all())

    def _renew(self) -> None:
        """The next feedforward, within the limits, and the velocity error it should leave."""
        task, before = self.task, self._applied
        wanted = task.base + self.update.correction
        self._torque = constrained(
            wanted, task.reference.q, task.reference.dq, task.arm, task.loop, task.limits, "practice"
        )
        self._applied = self._torque - task.base
        # What lies beyond the band stays as it is; what was off within it comes back by Λ.
        lines = to_lines(self.update.correction - before)
        gain = np.minimum(task.certificate.gain_at(self._frequency), 1.0)[:, None]
        left = (gain * lines) ** 2 + self.update.variance + to_lines(self._torque - wanted) ** 2
        systematic = np.sum(self._response * left, axis=0) / task.reference.samples
        beyond = self._beyond_band()
        self._predicted = np.sqrt(self.repeatability.velocity**2 + systematic + beyond)

    def _beyond_band(self) -> Array:
        """(n,) mean square velocity error of what is never learnt, from the first trials' spectrum."""
        closed = 1.0 - low_pass(self._frequency, self.task.certificate.band_hz)[:, None]
        excess = np.maximum(self._lacked.innovation**2 - self._lacked.variance, 0.0)
        return np.asarray(np.sum(self._response * closed * excess, axis=0) / self.task.reference.samples)

    def _velocity_response(self) -> Array:
        """(lines, n): |δdq/δu_ff|² of each joint's own closed loop, (rad/s)²/(N·m)²."""
        omega = 2j * np.pi * self._frequency[:, None]
        inertia = np.mean(np.diagonal(self.task.arm.inertia, axis1=1, axis2=2), axis=0)
        loop = self.task.loop
        return np.asarray(np.abs(omega / (inertia * omega**2 + loop.damping * omega + loop.stiffness)) ** 2)

    def _findings(self, rms: Array, change: Change, names: Sequence[str]) -> tuple[str, ...]:
        told = []
        for i, name in enumerate(names):
            if change.changed[i]:
                told.append(
                    f"{name}: the arm is not as it was: its torque differs {np.sqrt(change.ratio[i]):.3g} times as "
                    "much as trials do; nothing was learnt from this trial (has the load changed?)"
                )
            elif change.drifting[i]:
                told.append(f"{name}: drifts: this trial differs from the expected one as the trial before did")
            elif np.isfinite(self._predicted[i]) and rms[i] > DISAGREEMENT * self._predicted[i]:
                told.append(
                    f"{name}: velocity error {rms[i]:.3g} rad/s where {self._predicted[i]:.3g} was predicted: the "
                    "model lacks something that this motion shows (etude diagnose names it)"
                )
        return tuple(told)
