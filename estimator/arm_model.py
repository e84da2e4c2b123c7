"""The model of an arm: rigid bodies with their inertial parameters, and the effects that were found beside them.

It predicts the torque that will be measured along a motion. `ArmModel.at_rate` gives the inverse model that a learner's
feedforward evaluates; `estimator.twin.replay` simulates it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import base_parameters
from estimator.diagnosis.telling.answer import GEAR, MOTOR, Diagnosis
from estimator.effects import Effect, Lateness, Parameters, Place, Signals, effect
from estimator.identification import LinkIdentification
from estimator.rigid_body import RigidBody
from estimator.terms import PARAMETER_OF
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FittedEffect:
    """An effect at its place with its parameters. Make it with `fitted_effect`."""

    name: str
    place: Place
    parameters: Parameters
    standard_error: Parameters = field(default_factory=dict)
    """Of those parameters that have one."""
    shape: Array | None = None
    """See `Effect.hidden`."""

    def torque(self, signals: Signals) -> Array:
        """(samples, n) N·m it adds to the measured torque."""
        return self.law.torque(self.place, self.parameters, signals, self.shape)

    def simulate(self, plant: PlantDraft) -> None:
        """Put it into a plant."""
        self.law.simulate_fitted(self.place, self.parameters, plant, self.shape)

    def lateness(self, body: RigidBody) -> Lateness:
        """What it makes be recorded late."""
        theta, _ = self.law.fitted_unknowns(self.place, self.parameters, self.shape)
        return self.law.lateness(body, self.place, theta)

    @property
    def law(self) -> Effect:
        """Its law."""
        return effect(self.name).of(self.parameters)

    @property
    def spends(self) -> bool:
        """Whether the motors give torque for it."""
        return self.law.spends(self.place)

    @property
    def measures_late(self) -> bool:
        """Whether it is a matter of recording alone: a motor need not be told."""
        return self.name == "transport_delay"


def fitted_effect(
    name: str,
    place: Place,
    theta: Array,
    coefficients: Array,
    standard_error: Mapping[str, float | Array] | None = None,
) -> FittedEffect:
    """From what a fit gives: non-linear parameters theta (p,) and coefficients (c,)."""
    found = effect(name)
    shape = np.asarray(theta, dtype=float)[list(found.hidden)] if found.hidden else None
    parameters = found.parameters(place, np.asarray(theta, dtype=float), np.asarray(coefficients, dtype=float))
    return FittedEffect(name, place, parameters, dict(standard_error or {}), shape)


@dataclass(frozen=True)
class ArmModel:
    """``body`` carries the inertial parameters; ``effects`` come beside."""

    body: RigidBody
    effects: tuple[FittedEffect, ...] = ()

    def extended(self, effects: Sequence[FittedEffect]) -> ArmModel:
        """The model with more effects. One of the same name and place takes the old one's stead."""
        given = {(new.name, new.place) for new in effects}
        kept = [old for old in self.effects if (old.name, old.place) not in given]
        return replace(self, effects=(*kept, *effects))

    def torque(self, q: Array, dq: Array, ddq: Array, t: Array) -> Array:
        """Torque (samples, n) N·m that will be measured along a motion.

        ``q, dq, ddq``: (samples, n) rad, rad/s, rad/s²; ``t`` (samples,) s from the motion's start, evenly spaced.
        """
        return self._torque(Signals.of_motion(self.body, t, q, dq, ddq), self.effects)

    def at_rate(self, rate_hz: float) -> InverseModel:
        """The inverse model for motions sampled at this rate."""
        return InverseModel(self, rate_hz)

    def plant(self) -> PlantDraft:
        """What the twin simulates."""
        draft = PlantDraft(self.body, self.body.prior())
        for one in self.effects:
            one.simulate(draft)
        return draft

    def _torque(self, signals: Signals, effects: Sequence[FittedEffect]) -> Array:
        late = Lateness.together(self.body.n, (one.lateness(self.body) for one in effects))
        answered = signals.answering_to(late) if late.is_any else signals
        total, beside = signals.tau_rigid.copy(), np.zeros_like(signals.q)
        # What is lost between a motor and its measurement goes with all that it gives for the others: last.
        for one in sorted(effects, key=lambda own: own.law.of_motor):
            torque = one.torque(replace(answered, tau_beside=beside) if one.law.of_motor else answered)
            total += torque if one.measures_late else answered.lagged(torque)
            if one.spends:
                beside = beside + torque
        return total


@dataclass(frozen=True)
class InverseModel:
    """The torque that a motor must be told: R̂⁻¹ of Eq. 6.11. A delay of a recorded channel is left out, for it is not
    the motor that is late."""

    model: ArmModel
    rate_hz: float

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """(samples, n) N·m of one motion (samples, n) each in rad, rad/s, rad/s², its first sample at its start."""
        t = np.arange(len(q)) / self.rate_hz
        signals = Signals.of_motion(self.model.body, t, q, dq, ddq)
        return self.model._torque(signals, [one for one in self.model.effects if not one.measures_late])


def diagnosed_model(body: RigidBody, found: Diagnosis) -> ArmModel:
    """The given model with the links' deviations within their tolerance and the effects that a diagnosis found.

    What lies between a motor and its joint's torque sensor is no part of the torque that the sensor measures, and what
    lies between two encoders none of the torque along the angle that the model is told.
    """
    base = base_parameters(body)
    deviation = np.linalg.pinv(base.combination) @ found.base_deviation
    effects = [
        FittedEffect(
            finding.effect,
            finding.place,
            {name: quantity.value for name, quantity in finding.parameters.items()},
            {name: quantity.standard_error for name, quantity in finding.parameters.items()},
            finding.shape,
        )
        for finding in found.findings
        if finding.place.channel not in (MOTOR, GEAR)
    ]
    return ArmModel(body.with_parameters(body.prior() + deviation), tuple(effects))


def identified_model(found: LinkIdentification) -> ArmModel:
    """The model that identifying links gives: the inertial parameters nearest the URDF's with the identified base
    parameters, and the joints' terms as effects."""
    body = found.identified_body(found.body.prior())
    rank = found.base.rank
    effects = []
    for term, value, error in zip(found.terms, found.value[rank:], found.standard_error[rank:], strict=True):
        name, _ = PARAMETER_OF[term.name]
        shape = np.array([term.width]) if term.name == "coulomb_friction" else None
        errors = {name: float(error)} if np.isfinite(error) else {}
        effects.append(FittedEffect(term.name, Place(term.joint), {name: float(value)}, errors, shape))
    return ArmModel(body, tuple(effects))
