"""Hitting a point with the tool at a time: the parameters are the angles at which the plan aims."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.motion import Motion
from config.motion.curves import Spline
from config.schema import Mode
from learner.tool_point import ToolPoint
from learner.trial import Trial
from service.practice.inverse_models import ArmTorques
from service.practice.planning import Practised, practised_of
from service.practice.task_file import HitTask
from service.practice.tasks import Numbers, model_feedforward

Array = NDArray[np.float64]
REACH_RAD = 0.2
STEP = 1e-4
AROUND = 21
"""Samples about the instant, through which a parabola is laid: one sample would carry a whole step of the encoder."""


class Hitting:
    """`TaskOnArm` of a `HitTask`. Raises InputError for a point out of reach."""

    outcomes = Numbers(("x", "y", "z"), ("m", "m", "m"))

    def __init__(self, name: str, task: HitTask, installation: Installation, mode: Mode, model: ArmTorques) -> None:
        self.name, self.model = name, model
        self._task, self._installation, self._mode = task, installation, mode
        names, joints = installation.joint_names, installation.joint
        self._tool = ToolPoint(model.model.body, installation.arm.tool_frame)
        self.parameters = Numbers(tuple(f"aim_{joint}" for joint in names), ("rad",) * len(names))
        self.wanted = np.array(task.point_m)
        share = task.at_s / task.duration_s
        between = (1.0 - share) * np.array(task.start_rad) + share * np.array(task.end_rad)
        limits = np.array([joint.limits.position_rad for joint in joints])
        self.start = self._tool.angles(self.wanted, between, limits)
        self.reach = np.full(len(names), REACH_RAD)
        steps = 2.0 * np.pi / np.array([joint.encoder.counts_per_turn for joint in joints])
        moved = [self._tool.at(self.start + STEP * unit) - self.wanted for unit in np.eye(len(names))]
        self.resolution = np.linalg.norm(np.column_stack(moved) / STEP * steps, axis=1) / np.sqrt(12.0)

    def predict(self, parameters: Array) -> Array:
        """The tool is where the plan aims."""
        return self._tool.at(parameters)

    def practised(self, parameters: Array) -> Practised:
        times = np.array([0.0, self._task.at_s, self._task.duration_s])
        points = np.array([self._task.start_rad, parameters, self._task.end_rad])
        motion = Motion(self.name, self._task.description, self._installation.joint_names, Spline(times, points))
        return practised_of(motion, self._installation, self._mode)

    def feedforward(self, parameters: Array, practised: Practised) -> Array:
        return model_feedforward(self.model, practised)

    def outcome(self, trial: Trial, parameters: Array) -> Array:
        """(3,) m: where the tool was at the time."""
        rate = self._installation.cycle.rate_hz
        reference = self.practised(parameters).reference
        at = reference.moving.start + self._task.at_s * rate
        rows = np.arange(round(at) - AROUND // 2, round(at) + AROUND // 2 + 1)
        if rows[0] < 0 or rows[-1] >= len(trial.q):
            raise InputError(self.name, f"cannot be judged {self._task.at_s:g} s after its begin", "give another at_s")
        q = np.polynomial.polynomial.polyfit(rows - at, trial.q[rows], 2)[0]
        return self._tool.at(q)
