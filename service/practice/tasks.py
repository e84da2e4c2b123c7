"""What task level learning needs of a task (Section 7.2): a plan of few parameters, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from driver.plan import Plan
from learner.constrained import constrained
from learner.linearisation import linearise, spread
from learner.trial import Trial
from service.practice.inverse_models import ArmTorques
from service.practice.planning import Practised
from service.practice.taught import base_torque

Array = NDArray[np.float64]
INSTANTS = 16


@dataclass(frozen=True)
class Numbers:
    """The names of a few numbers, and their units."""

    names: tuple[str, ...]
    units: tuple[str, ...]


class TaskOnArm(Protocol):
    """One task on one arm, with a model that says which way a parameter moves the outcome."""

    name: str
    parameters: Numbers
    outcomes: Numbers
    start: Array
    """Parameters of the first plan."""
    reach: Array
    """The most by which a trial changes each."""
    wanted: Array
    resolution: Array
    """Standard deviation of an outcome that the sensors' steps alone leave."""
    model: ArmTorques

    def predict(self, parameters: Array) -> Array:
        """The model's outcome."""
        ...

    def practised(self, parameters: Array) -> Practised:
        """The motion that is played. Raises InputError beyond a limit."""
        ...

    def feedforward(self, parameters: Array, practised: Practised) -> Array:
        """(samples × joints) N·m, in time with a trial's torque."""
        ...

    def outcome(self, trial: Trial, parameters: Array) -> Array:
        """What came of it."""
        ...


def plan_of(task: TaskOnArm, parameters: Array, name: str) -> tuple[Practised, Plan]:
    """What the loop plays with these parameters, within the limits."""
    practised = task.practised(parameters)
    r = practised.reference
    at = spread(r.samples, INSTANTS)
    arm = linearise(task.model.momentary, r.q[at], r.dq[at], r.ddq[at])
    torque = constrained(
        task.feedforward(parameters, practised), r.q, r.dq, arm, practised.loop, practised.limits, practised.name
    )
    return practised, practised.plan(practised.timing.command(torque), f"{practised.name}-{name}")


def model_feedforward(model: ArmTorques, practised: Practised) -> Array:
    """The model's torque for the motion."""
    return base_torque(model, practised)
