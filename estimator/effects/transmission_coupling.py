"""Transmission coupling: two joints share a transmission, and what rubs or turns there follows both of them."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.coulomb_friction import SHARP, WIDTHS
from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Scales, Signals, averaged_sign
from estimator.rigid_body import RigidBody
from estimator.twin.plant import Coupling, PlantDraft

Array = NDArray[np.float64]

RATIOS = (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)
"""Ratios to try."""
SOFT = WIDTHS[2:]
"""Widths of a soft sign to try with joints that turn it alike, which most do: another ratio's is refined from a sharp
one."""
APART = 2
"""Joints that share a transmission lie at most this many apart in the chain, as the three of a wrist do."""


class TransmissionCoupling(Effect):
    """With w = dq + ratio·dq_other the combination spends b·w + c·sign(w) + J·dw/dt; the joint feels it once, the other
    ``ratio`` times. ``coefficient`` is b, ``level`` c, ``inertia`` J: of a wrist whose motors sit behind it, a rotor
    that two joints turn. theta is the ratio and the sign's width."""

    name = "transmission_coupling"
    dry = True
    units: ClassVar = {
        "joint_other": "–",
        "ratio": "–",
        "coefficient": "N·m·s/rad",
        "level": "N·m",
        "inertia": "kg·m²",
    }
    hidden = (1,)
    as_of_one: ClassVar = {"viscous_friction": 0, "rotor_inertia": 2}
    confused_with = ("coulomb_friction", "viscous_friction", "rotor_inertia", "link_inertia")
    seen_against = "dq"
    experiment = "move {joint} alone, the joint it shares a transmission with alone, then both together"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(i, other=j) for i in range(body.n) for j in range(i + 1, min(i + APART + 1, body.n))]

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return pair(place)

    def grid(self, place: Place, scales: Scales) -> Array:
        joint, other = pair(place)
        shapes = [(ratio, WIDTHS[0]) for ratio in RATIOS] + [(ratio, width) for ratio in (-1.0, 1.0) for width in SOFT]
        return np.array([[r, width * (scales.dq[joint] + abs(r) * scales.dq[other])] for r, width in shapes])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint, other = pair(place)
        ratio, width = map(float, theta)
        speed = signals.dq[:, joint] + ratio * signals.dq[:, other]
        turned = signals.ddq[:, joint] + ratio * signals.ddq[:, other]
        spent = np.stack([speed, averaged_sign(speed, width), turned], axis=1)
        return np.stack([spent, ratio * spent], axis=1)

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return np.zeros(3), np.full(3, np.inf)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        spent = dict(zip(("coefficient", "level", "inertia"), map(float, coefficients), strict=True))
        return {"joint_other": pair(place)[1], "ratio": float(theta[0]), **spent}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        ratio, viscous, level = (float(parameters[name]) for name in ("ratio", "coefficient", "level"))
        # Models that were written before the law had an inertia have none.
        inertia = float(parameters.get("inertia", 0.0))
        return np.array([ratio, SHARP]), np.array([viscous, level, inertia])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        (ratio, _), spent = self.unknowns(place, parameters)
        plant.couplings.append(Coupling(*pair(place), float(ratio), *map(float, spent)))


def pair(place: Place) -> tuple[int, int]:
    """The two joints of a place, which it always has."""
    assert place.joint is not None
    assert place.other is not None
    return place.joint, place.other


EFFECT = TransmissionCoupling()
