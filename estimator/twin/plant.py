"""What the twin's plant is made of: the rigid body, and what the effects put into it.

Effects write into a `PlantDraft`. What MuJoCo has an element for goes into its arrays and lists of elements, which an
export can write; any other law goes into a list of functions that the replay evaluates at every step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]


class Instant:
    """One joint at one moment of the simulation, on the motor's side of its transmission."""

    __slots__ = ("dq", "motor", "q", "t", "transmitted")

    def __init__(self) -> None:
        self.q = 0.0
        """rad"""
        self.dq = 0.0
        """rad/s"""
        self.t = 0.0
        """s since the replay's start"""
        self.motor = 0.0
        """N·m that the motor gives"""
        self.transmitted = 0.0
        """N·m of it that reached the link in the step before"""


Law = Callable[[Instant], float]
"""N·m at a joint."""
Curve = Callable[[float], float]
"""From the true to the measured quantity, or back."""


@dataclass(frozen=True)
class Series:
    """What lies between a motor and its link: a spring N·m/rad with a damper N·m·s/rad, or a gap rad."""

    stiffness: float = 0.0
    damping: float = 0.0
    gap: float = 0.0
    motor_share: float = 0.0
    """Of the joint's own inertia in the model, what is the motor's; 0: the model's bodies are the link's alone."""
    link_side: bool = False
    """Whether the joint's encoder sits on the link."""


@dataclass(frozen=True)
class Coupling:
    """What acts on the speed dq + ratio·dq_other: viscous N·m·s/rad, a level N·m, an inertia kg·m²."""

    joint: int
    other: int
    ratio: float
    viscous: float
    level: float
    inertia: float


@dataclass(frozen=True)
class Push:
    """A force (3,) N in the base's frame that the arm meets at the last link's origin, from and until s."""

    force: Array
    start: float
    end: float


@dataclass(frozen=True)
class Wall:
    """A plane that the last link's origin presses into, and that pushes it back along its normal."""

    normal: Array
    """(3,) unit vector into the wall, in the base's frame."""
    distance: float
    """m along it from the base's origin."""
    stiffness: float
    """N/m"""


@dataclass
class PlantDraft:
    """A plant in the making; arrays over joints are (n,) in the order of the body."""

    body: RigidBody
    parameters: Array
    """(10·n,) inertial parameters."""
    gravity: Array = field(init=False)
    viscous: Array = field(init=False)
    """N·m·s/rad"""
    friction: Array = field(init=False)
    """N·m that oppose any motion."""
    armature: Array = field(init=False)
    """kg·m² of rotors, at the joint."""
    stiffness: Array = field(init=False)
    """N·m/rad of springs about `centre` (rad)."""
    centre: Array = field(init=False)
    offset: Array = field(init=False)
    """N·m that are measured and never reach the joint."""
    gain: Array = field(init=False)
    """True over measured torque."""
    velocity_gain: Array = field(init=False)
    """Measured over true velocity."""
    angle_offset: Array = field(init=False)
    """True less measured angle, rad."""
    series: dict[int, Series] = field(default_factory=dict)
    couplings: list[Coupling] = field(default_factory=list)
    pushes: list[Push] = field(default_factory=list)
    walls: list[Wall] = field(default_factory=list)
    rubbing: list[tuple[int, Law]] = field(default_factory=list)
    """Friction beside `friction`: what the law gives, of either sign, is added to the level."""
    spending: list[tuple[int, Law]] = field(default_factory=list)
    """Torque that the motor spends beside the rigid body's."""
    motor: list[tuple[int, Curve]] = field(default_factory=list)
    """From the measured torque to the true one, before `gain`."""
    angle: list[tuple[int, Curve]] = field(default_factory=list)
    """From the true angle to the measured one."""
    late: dict[str, Array] = field(default_factory=dict)
    """Channel → (n,) s by which each joint is recorded late."""

    def __post_init__(self) -> None:
        n = self.body.n
        self.parameters = np.array(self.parameters, dtype=float)
        self.gravity = np.array(self.body.gravity, dtype=float)
        for name in ("viscous", "friction", "armature", "stiffness", "centre", "offset", "angle_offset"):
            setattr(self, name, np.zeros(n))
        self.gain, self.velocity_gain = np.ones(n), np.ones(n)

    def add_spring(self, joint: int, stiffness: float, centre: float) -> None:
        """k·(q − centre). MuJoCo's joints have one spring, and none that pushes away."""
        if stiffness > 0.0:
            total = self.stiffness[joint] + stiffness
            self.centre[joint] = (self.stiffness[joint] * self.centre[joint] + stiffness * centre) / total
            self.stiffness[joint] = total
        else:
            self.spending.append((joint, lambda at: stiffness * (at.q - centre)))

    def add_series(self, joint: int, series: Series) -> None:
        """Springs and gaps of one joint lie one behind the other."""
        old = self.series.get(joint, Series())
        soft = [s for s in (old.stiffness, series.stiffness) if s > 0.0]
        stiffness = 1.0 / sum(1.0 / s for s in soft) if soft else 0.0
        self.series[joint] = Series(
            stiffness,
            max(old.damping, series.damping),
            old.gap + series.gap,
            max(old.motor_share, series.motor_share),
            old.link_side or series.link_side,
        )
