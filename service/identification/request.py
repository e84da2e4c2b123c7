"""What to identify from what, as plain data: it travels to a worker's process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

LOAD_FILE = "load.toml"
"""In an identification's directory: the load it found."""
EstimatorName = Literal[
    "optimal_filter",
    "least_squares",
    "weighted",
    "whitened",
    "instrumental_variables",
    "total_least_squares",
    "maximum_likelihood",
]
"""The estimators of `estimator.links`, named here so that asking does not load them."""


@dataclass(frozen=True)
class LinksRequest:
    """What to identify from what. ``arm``: a configured name, an installation or URDF file, or None for the arm that
    the recordings carry. ``directory`` takes ``links.toml`` and ``torques.png``."""

    recordings: tuple[Path, ...]
    directory: Path
    hold_out: tuple[Path, ...] = ()
    arm: str | None = None
    hold: Mapping[str, float] = field(default_factory=dict)
    topic: str = "/joint_states"
    estimator: EstimatorName = "optimal_filter"
    band_hz: float | None = None


def as_paths(given: Sequence[str]) -> tuple[Path, ...]:
    """Paths as given on a command line, absolute, so that any process can read them."""
    return tuple(Path(text).absolute() for text in given)


LoadForm = Literal["differentiated", "integrated", "static"]
"""The forms of the load's equation: Eq. 3.12, Eq. 3.21, and rests alone (Eq. 3.19, 3.20)."""


@dataclass(frozen=True)
class Tolerance:
    """By how much a load may differ from the expected one."""

    mass_kg: float = 0.010
    centre_m: float = 0.001


@dataclass(frozen=True)
class LoadRequest:
    """What load to identify from what. ``without``: recordings of the arm without it; then the joint torques tell.

    ``hand`` and ``tares`` (recordings at rest without the load) are taken off the wrench. ``library`` holds known
    loads to recognise it among, ``expect`` the one it should be. ``frame``: the sensor's link of the URDF, or the
    flange's; None for the configured one. ``directory`` takes ``load.toml`` and the plot.
    """

    recordings: tuple[Path, ...]
    directory: Path
    without: tuple[Path, ...] = ()
    hold_out: tuple[Path, ...] = ()
    tares: tuple[Path, ...] = ()
    hand: Path | None = None
    library: Path | None = None
    expect: Path | None = None
    tolerance: Tolerance = Tolerance()
    arm: str | None = None
    hold: Mapping[str, float] = field(default_factory=dict)
    topic: str = "/joint_states"
    frame: str | None = None
    form: LoadForm = "differentiated"
    band_hz: float | None = None


@dataclass(frozen=True)
class TorqueConstantRequest(LoadRequest):
    """What is loaded, and ``without`` the load, to calibrate torque constants from; nothing is written."""
