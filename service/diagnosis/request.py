"""What to diagnose from what, as plain data: it travels to a worker's process."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class DiagnoseRequest:
    """``arm``: a configured name, an installation or URDF file, or None for the arm that the recordings carry.
    ``tolerance``: relative standard deviation to which the arm's link parameters are believed."""

    recordings: tuple[Path, ...]
    hold_out: tuple[Path, ...] = ()
    arm: str | None = None
    hold: Mapping[str, float] = field(default_factory=dict)
    topic: str = "/joint_states"
    tolerance: float = 0.05
    directory: Path | None = None
    """Where the answer, its traces and its page are kept; None: nowhere."""
    drives_off: tuple[Path, ...] = ()
    """Recordings at rest with the drives off."""
    experiments: tuple[Mapping[str, Any], ...] = ()
    """What was played to decide, or read, as the answer lists it; ``gap`` of the newest is not yet known."""
