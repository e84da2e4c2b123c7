"""Learning operators: how the error of a trial becomes the error of its command, δû = L(x − x_d).

Each says what it does to a trial, and its linear response along the motion, from which the certificate judges it.
The next feedforward is u_ff = u − δû (Eq. 6.11).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from learner.feedback_loop import FeedbackLoop
from learner.inverse_model import InverseModel
from learner.kinematics import Kinematics
from learner.linearisation import LinearArm, linearise
from learner.trial import Reference, Trial

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class LearningOperator(Protocol):
    """Turns a trial's error into its command's error, and can say beforehand what that does."""

    @property
    def name(self) -> str:
        """What the command line calls it."""
        ...

    def command_error(self, trial: Trial, reference: Reference) -> Array:
        """δûⁱ (samples × n, N·m), in time with the trial's torque (Eq. 6.7)."""
        ...

    def response(self, frequencies: Array, reference: Reference, at: NDArray[np.intp]) -> Complex:
        """L of δû = L·(δq, δdq) at the instants ``at`` of the reference: (frequencies, instants, n, 2n)."""
        ...

    def impulse(self, reference: Reference, at: NDArray[np.intp]) -> tuple[Array, Array]:
        """(now, before): δû[k] = now·y[k] + before·y[k−1] without any filter, (instants, n, 2n) each."""
        ...


@dataclass(frozen=True)
class ModelOperator:
    """The thesis' operator: R̂⁻¹(x) − R̂⁻¹(x_d) with data and reference treated alike (Eq. 6.7).

    With the arm's identified model it is non-linear and couples the joints; with a `DecoupledModel` it is Eq. 6.14.
    """

    model: InverseModel
    kinematics: Kinematics
    name: str = "thesis"
    momentary: InverseModel | None = None
    """The model as it is linearised at single instants; ``model`` itself unless that remembers earlier samples."""

    def command_error(self, trial: Trial, reference: Reference) -> Array:
        done = self.model.torque(*self.kinematics.at_torques(trial.q, trial.dq))
        wanted = self.model.torque(*self.kinematics.at_torques(reference.q, reference.dq))
        return np.asarray(done - wanted)

    def response(self, frequencies: Array, reference: Reference, at: NDArray[np.intp]) -> Complex:
        return _response(self.impulse(reference, at), frequencies, reference.period)

    def impulse(self, reference: Reference, at: NDArray[np.intp]) -> tuple[Array, Array]:
        arm = linearise(self.momentary or self.model, reference.q[at], reference.dq[at], reference.ddq[at])
        return inverse_of(arm, reference.period)


@dataclass(frozen=True)
class ProportionalOperator:
    """No model: the next feedforward is the last one plus ``share`` of the feedback's torque (after Arimoto 1984)."""

    loop: FeedbackLoop
    share: float = 1.0
    name: str = "proportional"

    def command_error(self, trial: Trial, reference: Reference) -> Array:
        error = np.hstack([trial.q - reference.q, trial.dq - reference.dq])
        return np.asarray((self.share - 1.0) * error @ self.loop.gains.T)

    def response(self, frequencies: Array, reference: Reference, at: NDArray[np.intp]) -> Complex:
        return _response(self.impulse(reference, at), frequencies, reference.period)

    def impulse(self, reference: Reference, at: NDArray[np.intp]) -> tuple[Array, Array]:
        now = np.tile((self.share - 1.0) * self.loop.gains, (len(at), 1, 1))
        return now, np.zeros_like(now)


def inverse_of(arm: LinearArm, period: float) -> tuple[Array, Array]:
    """(now, before) of a linear arm's inverse at mid-sample: M·Δdq/h + D·mean(dq) + G·mean(q)."""
    half_g, half_d, per = arm.stiffness / 2.0, arm.damping / 2.0, arm.inertia / period
    return np.concatenate([half_g, half_d + per], axis=-1), np.concatenate([half_g, half_d - per], axis=-1)


def _response(impulse: tuple[Array, Array], frequencies: Array, period: float) -> Complex:
    now, before = impulse
    back = np.exp(-2j * np.pi * np.asarray(frequencies) * period)[:, None, None, None]
    return np.asarray(now[None] + back * before[None])
