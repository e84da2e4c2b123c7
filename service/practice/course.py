"""What a practice is about, decided before anything moves: motion, model, operator, certificate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from config import Installation
from config.schema import Mode
from learner.certificate import Certificate, certify
from learner.error_gain import Tolerance
from learner.inverse_model import DecoupledModel, mean_inertia
from learner.kinematics import Kinematics
from learner.operators import LearningOperator, ModelOperator, ProportionalOperator
from learner.practice import Task, prepare
from learner.sticking import Sticking, sticking
from learner.trial import Trial
from learner.velocity_sensor import as_read
from service.practice.inverse_models import ArmTorques, load_inverse_model
from service.practice.planning import INERTIA_TOLERANCE, UNKNOWN_DELAY_S, Practised, practised_motion

OperatorName = Literal["thesis", "decoupled", "proportional"]
FLAT_HZ = 150.0
"""Of the kinematics' low-pass: above all that practice learns."""


class PracticeArguments(BaseModel):
    """What `etude certify` and `etude practise` are asked."""

    model_config = ConfigDict(extra="forbid")

    motion: str
    model: str | None = None
    """A model file, an arm's newest model or ARM@VERSION; the arm's URDF when absent."""
    operator: OperatorName = "thesis"
    mode: Mode = "csp"
    band_hz: Annotated[float, Field(gt=0)] | None = None
    """Nothing is learnt above it; None leaves it to the certificate."""
    hand_picked_hz: Annotated[float, Field(gt=0)] | None = None
    """The thesis' own update, gain one below this frequency, in place of the trial filter."""
    trials: Annotated[int, Field(ge=1, le=100)] = 10
    replays: Annotated[int, Field(ge=5, le=50)] = 5
    resume: str | None = None
    """Id of a session that ended early."""

    def learnt_up_to(self, certified_hz: float) -> float:
        """Hz, of the certificate's band and the hand-picked one the lower."""
        return min(certified_hz, self.hand_picked_hz or certified_hz)


@dataclass(frozen=True)
class Course:
    """``operator`` and its ``certificate`` for one motion; `task` begins with it."""

    practised: Practised
    model: ArmTorques
    kinematics: Kinematics
    operator: LearningOperator
    certificate: Certificate

    def task(self) -> Task:
        """Raises InputError when the certificate refuses the operator."""
        p = self.practised
        return prepare(
            self.model,
            self.model.momentary,
            p.reference,
            self.kinematics,
            self.operator,
            self.certificate,
            p.loop,
            p.timing,
            p.limits,
        )

    @property
    def sticking(self) -> Sticking:
        """What the model's dry friction does to the first trial."""
        return sticking(self.model, self.model.sliding, self.practised.reference, self.practised.loop)

    def as_counted(self) -> list[Trial]:
        """The wanted motion as the encoders of joints without velocity sensors would tell it, see `as_read`."""
        p = self.practised
        return as_read(p.reference, p.count_rad, ~p.velocity_measured, self.certificate.band_hz)


def course(asked: PracticeArguments, installation: Installation) -> Course:
    """Raises InputError naming what is wrong with the motion or the model. The certificate may refuse: look at it."""
    model = load_inverse_model(asked.model, installation)
    practised = practised_motion(asked.motion, installation, asked.mode)
    reference = practised.reference
    kinematics = Kinematics(reference.period, held=practised.timing.held, flat_hz=FLAT_HZ)
    operator = _operator(asked.operator, practised, model, kinematics)
    period = reference.period
    tolerance = Tolerance(INERTIA_TOLERANCE, UNKNOWN_DELAY_S + 0.5 * period)
    certificate = certify(model.momentary, reference, practised.loop, operator, tolerance, asked.band_hz)
    return Course(practised, model, kinematics, operator, certificate)


def _operator(name: OperatorName, practised: Practised, model: ArmTorques, kinematics: Kinematics) -> LearningOperator:
    if name == "proportional":
        return ProportionalOperator(practised.loop)
    if name == "decoupled":
        return ModelOperator(DecoupledModel(mean_inertia(model.momentary, practised.reference.q)), kinematics, name)
    return ModelOperator(model.sliding, kinematics, momentary=model.momentary)
