"""Pure mathematics on arrays: what an arm and its loads weigh, and with which certainty."""

from estimator.base_parameters import BaseParameters, base_parameters
from estimator.identification import LinkIdentification
from estimator.links import LinkOptions, identify_links
from estimator.regressor import inverse_dynamics, torque_regressor
from estimator.rigid_body import RigidBody, load_rigid_body
from estimator.trajectory import Trajectory

__all__ = [
    "BaseParameters",
    "LinkIdentification",
    "LinkOptions",
    "RigidBody",
    "Trajectory",
    "base_parameters",
    "identify_links",
    "inverse_dynamics",
    "load_rigid_body",
    "torque_regressor",
]
