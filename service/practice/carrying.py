"""Carrying an unknown payload: the parameters are its mass and first moments about the tool.

What it needs besides is what the servo has to add. A motion tells the four numbers in one go; the next trials tell
whether they held at the motion that they made possible. The payload's own moments of inertia about the tool are left
out: they are small beside those of its place at the arm's end.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from config import Installation
from config.schema import Mode
from estimator.regressor import torque_regressor
from learner.kinematics import Kinematics
from learner.trial import Trial
from service.practice.course import FLAT_HZ
from service.practice.inverse_models import ArmTorques
from service.practice.planning import Practised, practised_motion
from service.practice.tasks import Numbers, model_feedforward

Array = NDArray[np.float64]
REACH = np.array([20.0, 4.0, 4.0, 4.0])
PASSES = 4
"""The first weighs the joints by what the payload itself does to them; the last ones by what it leaves."""
SMALLEST = 1e-6
"""Of each parameter, where replays are alike to the last bit."""


class Carrying:
    """`TaskOnArm` of a `CarryTask`. Raises InputError for a motion beyond the limits."""

    parameters = outcomes = Numbers(("mass", "mcx", "mcy", "mcz"), ("kg", "kg·m", "kg·m", "kg·m"))

    def __init__(self, name: str, motion: str, installation: Installation, mode: Mode, model: ArmTorques) -> None:
        """``motion``: by name or file."""
        self.name, self.model = name, model
        self.start, self.wanted = np.zeros(4), np.zeros(4)
        self.reach, self.resolution = REACH, np.full(4, SMALLEST)
        self._practised = practised_motion(motion, installation, mode)
        r = self._practised.reference
        self._kinematics = Kinematics(r.period, held=self._practised.timing.held, flat_hz=FLAT_HZ)
        body = model.model.body
        frame = body.model.frames[body.model.getFrameId(installation.arm.tool_frame)]
        self._link, self._to_link = frame.parentJoint - 1, _payload_at(frame.placement)

    def predict(self, parameters: Array) -> Array:
        """What is missed falls by what is put into the plan."""
        return -np.asarray(parameters)

    def practised(self, parameters: Array) -> Practised:
        return self._practised

    def feedforward(self, parameters: Array, practised: Practised) -> Array:
        r = practised.reference
        exact = Kinematics(r.period, held=practised.timing.held, flat_hz=None).at_torques(r.q, r.dq)
        return model_feedforward(self.model, practised) + self._columns(*exact) @ parameters

    def outcome(self, trial: Trial, parameters: Array) -> Array:
        """(4,) payload that the plan lacks, by least squares over the moving samples, each joint by what is left."""
        moving = self._practised.reference.moving
        done = self._kinematics.at_torques(trial.q, trial.dq)
        columns = self._columns(*done)
        lacking = (trial.tau - self.model.torque(*done) - columns @ parameters)[moving]
        columns, left, found = columns[moving], lacking, np.zeros(4)
        for _ in range(PASSES):
            weight = 1.0 / np.maximum(np.std(left, axis=0), SMALLEST)
            rows = (columns * weight[None, :, None]).reshape(-1, 4)
            found = np.asarray(np.linalg.lstsq(rows, (lacking * weight).ravel(), rcond=None)[0])
            left = lacking - columns @ found
        return found

    def _columns(self, q: Array, dq: Array, ddq: Array) -> Array:
        """(samples, n, 4) N·m per unit of each parameter."""
        whole = torque_regressor(self.model.model.body, q, dq, ddq)
        return np.asarray(whole[:, :, 10 * self._link : 10 * self._link + 10] @ self._to_link)


def _payload_at(placement: pin.SE3) -> Array:
    """(10, 4): the link's parameters (m, mc, six moments about its frame) per unit of the payload's."""
    there, turn = np.array(placement.translation), np.array(placement.rotation)
    columns = [np.concatenate([[1.0], there, _moments(there, there)])]
    columns += [np.concatenate([[0.0], axis, 2.0 * _moments(there, axis)]) for axis in turn.T]
    return np.column_stack(columns)


def _moments(a: Array, b: Array) -> Array:
    """(6,) of −(S(a)·S(b) + S(b)·S(a))/2, which for a = b are the moments of a unit mass there."""
    whole = float(a @ b) * np.eye(3) - 0.5 * (np.outer(a, b) + np.outer(b, a))
    return np.asarray(whole[np.triu_indices(3)])
