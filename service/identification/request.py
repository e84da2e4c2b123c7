"""What to identify from what, as plain data: it travels to a worker's process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

EstimatorName = Literal["least_squares", "weighted", "whitened", "instrumental_variables"]
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
    estimator: EstimatorName = "weighted"
    band_hz: float | None = None


def as_paths(given: Sequence[str]) -> tuple[Path, ...]:
    """Paths as given on a command line, absolute, so that any process can read them."""
    return tuple(Path(text).absolute() for text in given)
