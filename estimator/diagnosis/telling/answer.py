"""What a diagnosis says: plain data, for reports, files and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.deciding.contest import Contest
from estimator.diagnosis.telling.traces import Traces
from estimator.effects import Place

Array = NDArray[np.float64]

Verdict = Literal["clean", "named", "ambiguous", "unknown"]
Status = Literal["named", "ambiguous"]
MOTOR = "motor"
"""The channel of a finding between a motor and its joint's torque sensor."""
GEAR = "gear"
"""The channel of a finding between the encoders on both sides of a gear."""


@dataclass(frozen=True)
class Quantity:
    """A parameter with its standard error: numbers, or vectors of one length."""

    value: float | Array
    standard_error: float | Array
    unit: str


@dataclass(frozen=True)
class Alternative:
    """A cause that could stand in for a finding."""

    effect: str
    place: Place
    log_likelihood_gap: float
    """Nats behind the finding, both less what their freedom costs."""
    decidable: bool = True
    """Whether there are motions that tell it from the finding."""


@dataclass(frozen=True)
class Finding:
    """One named, or nearly named, cause."""

    effect: str
    place: Place
    status: Status
    parameters: dict[str, Quantity]
    log_likelihood_gain: float
    """Nats that are lost without it, all other findings kept."""
    false_alarm_probability: float
    """Of the whole family of hypotheses, under chance."""
    share_of_explainable: float
    """Of what it acts on and any model could explain, how much is lost without it."""
    alternatives: tuple[Alternative, ...]
    """Nearest first."""
    rivals: tuple[Alternative, ...]
    """Every other hypothesis in its stead, nearest first: what is asked of data that an experiment has added."""
    next_experiment: str | None
    """The motion that would tell an ambiguous finding from its alternatives, one sentence."""
    shape: Array | None = None
    """See `Effect.hidden`."""
    contest: Contest | None = None
    """Of an ambiguous finding with its alternatives: what a deciding motion is designed from."""


@dataclass(frozen=True)
class Residual:
    """Of one joint's torque in the compared band, rms."""

    before: float
    after: float
    noise: float
    unit: str
    """N·m, of a sliding joint N."""


@dataclass(frozen=True)
class Unexplained:
    """What repeats in one joint's torque and no finding explains."""

    share: float
    """Of the joint's explainable."""
    signature: str
    nameless: bool = True
    """Whether its cause has no name; else one that has is another one in each recording."""


@dataclass(frozen=True)
class HeldOut:
    """Torque residual over all joints on data that the findings were not fitted to, rms: N·m; N where all joints
    slide."""

    before: float
    after: float
    share_of_explainable: float | None
    """Each joint in multiples of its noise; None where what was left out shows nothing beyond it."""


@dataclass(frozen=True)
class Diagnosis:
    """The answer about one arm's recordings. Indices of joints are those of ``joints``."""

    joints: tuple[str, ...]
    verdict: Verdict
    findings: tuple[Finding, ...]
    """Most evidence first."""
    unexplained: dict[int, Unexplained]
    torque_residual: tuple[Residual, ...]
    held_out: HeldOut
    smallest_detectable: dict[str, dict[int | None, float]]
    """By effect and joint (None: the whole arm), in the unit of the effect's first measured parameter."""
    detectable_units: dict[str, str]
    """By effect, of `smallest_detectable`."""
    notes: tuple[str, ...]
    """What a reader must know to trust it: where the noise comes from, what the motion cannot tell."""
    traces: Traces
    band: float
    """Hz up to which torques were compared."""
    base_deviation: Array
    """(rank,) by how much the base parameters differ from the given model's, within its tolerance."""
    drive_residual: Mapping[int, Residual] = field(default_factory=dict)
    """By joint, what its motor spends beside the torque that its sensor reads, where both were recorded."""
    gear_residual: Mapping[int, Residual] = field(default_factory=dict)
    """By joint, what its motor's angle is ahead of the one behind the gear, where both were recorded: rad; m."""
