"""The inverse model that commands use: a model file, or the arm's URDF where none was identified."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody
from estimator.terms import TERM_NAMES, Term
from service.identification.arm_source import of_installation
from service.identification.model_file import LinkModel, read_link_model

Array = NDArray[np.float64]
NAMES = {str(name): name for name in TERM_NAMES}


@dataclass(frozen=True)
class ArmTorques:
    """Rigid bodies and joint terms: `learner.inverse_model.InverseModel`."""

    body: RigidBody
    parameters: Array
    terms: tuple[tuple[Term, float], ...]
    source: str
    """What to call it in an answer."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        tau = self.rigid(q, dq, ddq)
        for term, value in self.terms:
            tau[:, term.joint] += value * term.column(dq[:, term.joint], ddq[:, term.joint])
        return tau

    def rigid(self, q: Array, dq: Array, ddq: Array) -> Array:
        """The rigid bodies' torque alone."""
        return inverse_dynamics(self.body, self.parameters, q, dq, ddq)

    def gravity(self, q: Array) -> Array:
        """Torque that holds the arm at rest at each pose (samples × n)."""
        still = np.zeros_like(q)
        return inverse_dynamics(self.body, self.parameters, q, still, still)

    def without_terms(self) -> ArmTorques:
        """The rigid bodies alone, as a model."""
        return ArmTorques(self.body, self.parameters, (), f"{self.source}, rigid bodies alone")


def load_inverse_model(path: Path | None, installation: Installation) -> ArmTorques:
    """The model in that file; without a file the installation's URDF.

    Raises InputError when it is no model file, or the model of another arm.
    """
    names = installation.joint_names
    body = of_installation(installation).rigid_body(names, {})
    if path is None:
        return ArmTorques(body, body.prior(), (), "the arm's URDF")
    model = read_link_model(path)
    if model.arm != installation.arm.name or model.joints != names:
        raise InputError(
            str(path),
            f"is a model of arm {model.arm} ({', '.join(model.joints)}), and this is {installation.arm.name}",
            "name a model that was identified on this arm",
        )
    parameters = np.concatenate([model.link_parameters[name] for name in names])
    return ArmTorques(body, parameters, _terms(model, path), str(path))


def _terms(model: LinkModel, path: Path) -> tuple[tuple[Term, float], ...]:
    found = []
    for term in model.joint_term:
        if term.effect not in NAMES:
            raise InputError(
                str(path), f"has the effect {term.effect!r}, which no joint term is called", "identify again"
            )
        found.append((Term(NAMES[term.effect], model.joints.index(term.joint), term.width or 0.0), term.value))
    return tuple(found)
