"""What practice has taught beyond its one motion: periodic torques for the model, a local model of the rest (7.1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.arm_model import FittedEffect
from learner.kinematics import Kinematics
from learner.local_model import LocalModel, States
from learner.periodic_torques import periodic_torques
from service.practice.inverse_models import ArmTorques
from service.practice.planning import Practised

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Taught:
    """``model`` has the ``effects`` that were named beside those it was given; ``rest`` is what neither explains."""

    model: ArmTorques
    effects: tuple[FittedEffect, ...]
    rest: LocalModel


def what_was_taught(model: ArmTorques, practised: Practised, torque: Array, band_hz: float) -> Taught:
    """From the ``torque`` (samples × joints, N·m) at which practice arrived, in time with a trial's, learnt up to
    ``band_hz`` with ``model`` as the teacher."""
    along = at_torques(practised)
    moving = practised.reference.moving
    correction = torque - base_torque(model, practised)
    parts = (along.q[moving], along.dq[moving], along.ddq[moving], correction[moving])
    effects = periodic_torques(model.model, *parts, practised.reference.period, band_hz)
    named = replace(model, model=replace(model.model, effects=(*model.model.effects, *effects)))
    return Taught(named, effects, LocalModel(along, torque - base_torque(named, practised)))


def at_torques(practised: Practised) -> States:
    """The reference at the instants at which torques act."""
    r = practised.reference
    return States(*Kinematics(r.period, held=practised.timing.held, flat_hz=None).at_torques(r.q, r.dq))


def base_torque(model: ArmTorques, practised: Practised) -> Array:
    """The model's torque for the reference (samples × joints, N·m), in time with a trial's."""
    along = at_torques(practised)
    return model.torque(along.q, along.dq, along.ddq)


def effects_answer(effects: tuple[FittedEffect, ...], names: tuple[str, ...]) -> list[dict[str, Any]]:
    """For JSON: effect, joint, parameters by name."""
    return [
        {
            "effect": one.name,
            "joint": names[one.place.joint],
            "parameters": {name: float(value) for name, value in one.parameters.items()},
        }
        for one in effects
        if one.place.joint is not None
    ]
