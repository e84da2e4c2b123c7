"""The interface of an effect: one physical cause by which an arm differs from its rigid-body model.

An effect enters the recorded equations linearly in some coefficients once its few non-linear parameters theta are
fixed:

    torque:    tau_measured = tau_rigid(q, dq, ddq) + columns(theta) · coefficients
    velocity:  dq_measured  = dq                    + columns(theta) · coefficients
    wrench:    f_measured   = load's wrench         + columns(theta) · coefficients

(A deflection is the difference of two angles, and has laws of its own: `estimator.diagnosis.gear_laws`.)

An error of a sensor enters by the model's derivative with respect to that sensor (`Signals.by_angle_error`).
Everything else (evidence, errors, confusion, the smallest size that would be seen) follows from the columns alone, so
a new effect is a new file with one subclass of `Effect`. A `Law` is the part of it that a search for causes
needs; maps have no more.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.effects.lateness import Lateness
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

Equation = Literal["torque", "velocity", "wrench", "deflection"]
SeenAgainst = Literal["q", "dq", "ddq", "tau", "t", "temperature", "law"]
Parameters = Mapping[str, float | Array]
"""The catalogue's parameters by name: numbers, and vectors (a centre, a matrix row after row)."""
NO_THETA = np.zeros((1, 0))
"""The grid of an effect without non-linear parameters."""


@dataclass(frozen=True)
class Place:
    """Where an effect lives: indices of the body's joints, the channel of a sensor; None where it does not apply."""

    joint: int | None = None
    channel: str | None = None
    other: int | None = None
    """The second joint of a pair."""


class Law(ABC):
    """What an equation of motion may have beside the given model, as columns: all that the search for causes looks at.

    Stateless: the same object serves all places and recordings.
    """

    name: ClassVar[str]
    units: ClassVar[Mapping[str, str]]
    """Of its parameters, in the form that it mostly has."""
    contains: ClassVar[tuple[str, ...]] = ()
    """Effects that are special cases of this one at the same joint: when they fit as well, they are preferred."""
    made_with: ClassVar[tuple[str, ...]] = ()
    """Effects that together with those it contains make much the same torque; preferred likewise."""
    experiment: ClassVar[str]
    """The motion that tells it from what it is confused with, one sentence; ``{joint}`` stands for the joint."""
    typical: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    """Coefficients that things of its name usually have beside one that it contains, per unit of that one's, either way
    where a thing may have either: only where recordings would show these is the plainer law named alone."""
    dry: ClassVar[bool] = False
    """Whether its torque turns over with the sign of a speed, and is anything within its level at none."""
    of_link: ClassVar[bool] = False
    """Whether it is one of a joint's link, which all joints before it bear too."""
    of_motor: ClassVar[bool] = False
    """Whether it lies between what a motor gives and what is measured of it: it goes with all of its torque, friction
    and springs too (`Signals.tau_motor`), and the motor gives nothing for it."""
    read_off: ClassVar[bool] = False
    """Whether the measured torque has it while the drive is off."""
    seen_against: ClassVar[SeenAgainst] = "law"
    """The quantity of the joint against which its torque shows its form; ``law``: its own prediction."""
    equation: ClassVar[Equation] = "torque"
    """Of all its places but those that `equation_at` knows better."""

    hidden: ClassVar[tuple[int, ...]] = ()
    """Which entries of theta the catalogue's parameters do not hold: the sharpness of a sign, the side of an encoder. A
    fitted effect keeps them beside its parameters as its shape."""
    choices: ClassVar[tuple[int, ...]] = ()
    """Which entries of theta are one of the grid's values and nothing between."""
    about: ClassVar[tuple[int, ...]] = ()
    """Which entries of theta are its first coefficients once more: it is not linear in them, and its columns times them
    are right for those that theta has. Of the grid they are zero, where columns are those of small ones."""
    factored: ClassVar[bool] = False
    """Whether its coefficient is one by right: a factor that a search leaves free, since a shape that is nearly right
    needs another (`at_one`)."""
    forms: ClassVar[tuple[int, ...]] = ()
    """Which entries of theta are told, and yet no freedom that could stand for another cause: an exponent."""
    known_up_to: ClassVar[tuple[float, ...]] = ()
    """Of each entry of theta, the largest that a thing of this name has; its grid goes farther, so that what only looks
    like one is seen not to be. Empty: what the grid holds."""
    beyond_known: ClassVar[str] = ""
    """What has a larger one, or of a line no period that is seen, as a signature of what has no name."""
    mends_below: ClassVar[float] = 0.0
    """With a first theta below, it differs from what it contains in form alone: where it explains little more than
    that, it stands for a form that the plainer law has not, and is told as that law. Zero: never."""
    exact_to: ClassVar[float] = 0.0
    """Of its parameters' values, what they are known to where things of its name have not quite its form: counted in
    their errors."""
    levels: ClassVar[tuple[int, ...]] = (0,)
    """Coefficients of which one or the other is that of the plainer law that it is, or contains (`typical`)."""
    named_for: ClassVar[tuple[int, ...]] = ()
    """Coefficients without which it would be another law; any other may be absent, where none can be negative."""
    confused_with: ClassVar[tuple[str, ...]] = ()
    """What it is mostly taken for. Where that has slow lines, two of them are compared with it."""
    looks_like: ClassVar[tuple[str, ...]] = ()
    """Effects of other shapes that it may look like where the motion shows a part of either: compared with each at the
    shape that suits it best."""
    as_of_one: ClassVar[Mapping[str, int]] = {}
    """Of one that two joints share, the effects of a single joint that one of its coefficients is of both: where it has
    that coefficient alone, what one of the joints spends besides may be the other's, at another ratio."""
    comes_and_goes: ClassVar[bool] = False
    """Whether it acts now and then alone: one that acts all of the time is something else."""
    sought: ClassVar[bool] = False
    """Whether its shape has so many dimensions that its grid is coarse in each: where it may stand for other causes,
    shapes between those of the grid are tried too (`around`)."""
    drifts: ClassVar[bool] = False
    """Whether its torque is another one in each playing of a motion."""
    recurs: ClassVar[bool] = False
    """Whether one place can have it several times, each with its own theta: the orders of a periodic torque."""

    def seen_at(self, theta: Array) -> SeenAgainst:
        """`seen_against`, of one with these."""
        return self.seen_against

    def known(self, theta: Array) -> bool:
        """Whether there are things of its name with these."""
        return bool(np.all(theta[: len(self.known_up_to)] <= np.array(self.known_up_to)))

    def told_by_repeats(self, theta: Array) -> bool:
        """Whether only a motion that is played again tells it, at this shape, from what it contains."""
        return False

    def plain(self, theta: Array) -> bool:
        """Whether it is, at this shape, the law that wider ones contain (`contains`)."""
        return True

    def usual(self, theta: Array) -> bool:
        """Whether it has its `typical` coefficients at this shape."""
        return bool(self.typical)

    def differs(self, theta: Array, coefficients: Array) -> bool:
        """Whether it is more with these than a form of what it contains."""
        return True

    def redundant(self, theta: Array) -> int:
        """How many numbers of its parameters the others tell."""
        return 0

    def exact_at(self, theta: Array, coefficients: Array) -> Array:
        """theta with which its columns hold for these coefficients, as large as they are (`about`)."""
        exact = theta.copy()
        exact[list(self.about)] = coefficients[: len(self.about)]
        return exact

    def at_one(self, theta: Array, coefficients: Array) -> Array:
        """theta with which one that is `factored` is as large as it is with these, its factor being one."""
        return theta

    def spends(self, place: Place) -> bool:
        """Whether motors give torque for it there: not for what lies in a measurement alone."""
        measured = self.of_motor or self.read_off or self.timed(place) is not None
        return self.equation_at(place) == "torque" and not measured

    def with_motor(self, theta: Array, inertia: float) -> Array | None:
        """theta of what lies between a motor of this ``inertia`` kg·m², which is beside the model's bodies, and a link
        that has the encoder; None of all else."""
        return None

    def timed(self, place: Place) -> int | None:
        """Of a law whose theta is the delay that its coefficient is too: the sign with which the timings of its
        channels add to that, 0 where none of them is this delay; None of all others."""
        return None

    def lateness(self, body: RigidBody, place: Place, theta: Array) -> Lateness:
        """What it makes be recorded late, of all that is recorded there."""
        late = Lateness.none(body.n)
        if (sign := self.timed(place)) is not None and self.equation_at(place) == "torque":
            late.delay[list(self.rows(body, place))] = sign * float(theta[0])
        return late

    def experiment_at(self, place: Place, body: RigidBody) -> str:
        """The same sentence for a place."""
        name = "the joint" if place.joint is None else body.joints[place.joint]
        return self.experiment.format(joint=name if "joint" in name else f"joint {name}")

    def equation_at(self, place: Place) -> Equation:
        """The equation that it enters at this place."""
        return self.equation

    def units_of(self, parameters: Parameters) -> Mapping[str, str]:
        """The units of these."""
        return self.units

    def choices_at(self, place: Place) -> Mapping[int, tuple[float, ...]]:
        """By entry of theta that is `hidden` and a choice, the values that it can have at this place."""
        return {}

    @abstractmethod
    def places(self, body: RigidBody) -> list[Place]:
        """Everywhere in this arm where it can live."""

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        """Which rows of its equation it enters: joints of torque and velocity, components 0 … 5 of the wrench.

        One joint's own by default.
        """
        return tuple(range(body.n)) if place.joint is None else (place.joint,)

    def grid(self, place: Place, scales: Scales) -> Array:
        """(k, p) the non-linear parameters to try first, one choice a row; they are refined later within the span of
        each column of the grid."""
        return NO_THETA

    def finer(self, place: Place, scales: Scales) -> Array:
        """(k, p) more that few arms have: tried where torques are left that those of the grid do not explain."""
        return NO_THETA[:0]

    def around(self, place: Place, scales: Scales, theta: Array, share: float) -> Array:
        """(k, p) shapes about one of a law that is `sought`, as far from it as a ``share`` of what lies between two of
        the grid."""
        return np.zeros((0, len(theta)))

    @abstractmethod
    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        """(samples, rows, c) for theta (p,): per unit of each of the c coefficients."""

    def columns_of_each(self, place: Place, signals: Signals, thetas: Sequence[Array]) -> Iterator[Array]:
        """`columns` for one theta after the other, for laws that make many at once sooner than one by one."""
        return (self.columns(place, signals, theta) for theta in thetas)

    def speed_rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        """Beside an equation of torques: the joints where it makes speeds differ from the slopes of the angles, which
        counts where a velocity sensor was recorded."""
        return ()

    def speed_columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        """(samples, speed rows, c) rad/s by which measured speeds then exceed those slopes, per unit of the same
        coefficients."""
        return np.zeros((signals.samples, 0, 1))

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array] | None:
        """Least and largest value (c,) that each of theta's coefficients can have physically; None: any."""
        return None

    @abstractmethod
    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        """The catalogue's parameters of theta (p,) and coefficients (c,)."""


class Effect(Law):
    """One cause.

    ``name`` and the keys of ``units`` (parameter → unit) are those of the catalogue.
    """

    momentary: ClassVar[bool] = False
    """Whether its torque is a smooth function of q, dq and ddq of one instant: it can be linearised there."""
    in_drive: ClassVar[bool] = False
    """Whether it acts between a motor and a torque sensor behind its gear: the sensor's torque stands for the model's
    there."""

    above_zero: ClassVar[tuple[str, ...]] = ()
    """Parameters that no thing of its name has at zero or below."""

    def laws(self) -> tuple[Effect, ...]:
        """All laws of its name: itself, and others of another kind."""
        return (self,)

    def of(self, parameters: Collection[str]) -> Effect:
        """The one of its `laws` that has parameters of these names."""
        return self

    @abstractmethod
    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        """theta (p,) and coefficients (c,) of the catalogue's parameters: the inverse of `parameters`."""

    def fitted_unknowns(self, place: Place, parameters: Parameters, shape: Array | None) -> tuple[Array, Array]:
        """`unknowns` with the `hidden` entries of theta as they were fitted; sharp signs without."""
        theta, coefficients = self.unknowns(place, parameters)
        if shape is not None:
            theta[list(self.hidden)] = shape
        return theta, coefficients

    def torque(self, place: Place, parameters: Parameters, signals: Signals, shape: Array | None = None) -> Array:
        """(samples, n) what an effect of the torque equation adds to the motors' torque along a motion, N·m.

        ``shape``: the `hidden` entries of theta, as they were fitted; sharp signs without.
        """
        if self.equation_at(place) != "torque":
            return np.zeros_like(signals.q)
        theta, coefficients = self.fitted_unknowns(place, parameters, shape)
        result = np.zeros_like(signals.q)
        result[:, list(self.rows(signals.body, place))] = self.columns(place, signals, theta) @ coefficients
        return result

    @abstractmethod
    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        """Put the effect into the twin's plant."""

    def form(self, shape: Array | None) -> str:
        """What a `hidden` shape is, in words that follow the effect's name; empty: nothing that a reader asks for."""
        return ""

    def simulate_fitted(self, place: Place, parameters: Parameters, plant: PlantDraft, shape: Array | None) -> None:
        """`simulate` of an effect that was fitted with these `hidden` entries of theta.

        The plant's signs are sharp, whatever the fit's: effects whose shape is more than that override this.
        """
        self.simulate(place, parameters, plant)


class JointEffect(Effect):
    """An effect that lives in any one joint and acts on that joint's torque alone."""

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(joint) for joint in range(body.n)]

    @staticmethod
    def joint(place: Place) -> int:
        """The place's joint, which it always has."""
        assert place.joint is not None
        return place.joint

    def nonnegative(self, count: int) -> tuple[Array, Array]:
        """Limits of ``count`` coefficients that cannot be negative."""
        return np.zeros(count), np.full(count, np.inf)


class WrenchEffect(Effect):
    """An effect of the wrist's wrench sensor; it leaves the motion as it is."""

    equation = "wrench"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(channel="wrench")]

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(6))

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        """The plant moves as before: what a wrist sensor reads is no force on the arm."""

    @staticmethod
    def wrench(signals: Signals) -> Array:
        """(samples, 6) what the given load should make the sensor read.

        Raises InputError when the signals come without a load.
        """
        if signals.load_wrench is None:
            raise InputError("wrench", "has no load to be compared with", "give the load, or identify it first")
        return signals.load_wrench
