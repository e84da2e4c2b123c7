"""The inverse model that commands use: a model file or a kept version, or the arm's URDF where none is named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config import Installation
from config.errors import InputError
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects import effect
from estimator.regressor import inverse_dynamics
from service.identification.arm_source import of_installation
from service.models.model_file import arm_model
from service.models.store import named_model

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ArmTorques:
    """A model of this arm at the loop's rate: `learner.inverse_model.InverseModel` of whole motions."""

    model: ArmModel
    rate_hz: float
    source: str
    """What to call it in an answer."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return self.model.at_rate(self.rate_hz).torque(q, dq, ddq)

    def rigid(self, q: Array, dq: Array, ddq: Array) -> Array:
        """The rigid bodies' torque alone."""
        return inverse_dynamics(self.model.body, self.model.body.prior(), q, dq, ddq)

    def gravity(self, q: Array) -> Array:
        """Torque that holds the arm at rest at each pose (samples × n)."""
        still = np.zeros_like(q)
        return self.rigid(q, still, still)

    @property
    def momentary(self) -> ArmTorques:
        """The model without what remembers or needs the samples before: for the arm linearised at single instants."""
        return self._with([one for one in self.model.effects if effect(one.name).of(one.parameters).momentary])

    @property
    def sliding(self) -> ArmTorques:
        """The model without dry friction: of trial and reference alike, by which a command's error is told."""
        return self._with([one for one in self.model.effects if not effect(one.name).of(one.parameters).dry])

    def _with(self, effects: Sequence[FittedEffect]) -> ArmTorques:
        return replace(self, model=replace(self.model, effects=tuple(effects)))


def load_inverse_model(name: str | None, installation: Installation) -> ArmTorques:
    """The model of that file or name; without one the installation's URDF.

    Raises InputError when there is none, or it is the model of another arm.
    """
    joints, rate = installation.joint_names, installation.cycle.rate_hz
    if name is None:
        return ArmTorques(ArmModel(of_installation(installation).rigid_body(joints, {})), rate, "the arm's URDF")
    file = named_model(name)
    if file.arm != installation.arm.name or file.joints != joints:
        raise InputError(
            name,
            f"is a model of arm {file.arm} ({', '.join(file.joints)}), and this is {installation.arm.name}",
            "name a model that was identified on this arm",
        )
    return ArmTorques(arm_model(file), rate, name)
