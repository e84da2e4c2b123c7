"""The identification on a recording of a real arm, where that recording is at hand."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import RenderableType

from config.loader import HERE
from service.identification.links import identify
from service.identification.request import LinksRequest
from service.reports.link_tables import residual_tables

DATA = HERE.parent.parent / "shared" / "data" / "franka_panda"
"""Measured by Gaz et al. (2019): not ours to ship, so it lies beside the repository or is absent."""
PUBLISHED_RELATIVE_ERROR = 1.41
"""Percent, classical least squares (Gaz et al. 2019)."""
URDF = HERE / "arms" / "panda" / "panda.urdf"


@dataclass(frozen=True)
class RealArm:
    answer: dict[str, Any] | None
    shown: list[RenderableType]


def identify_real_arm(out: Path) -> RealArm:
    """Links of the Franka Panda from its published recording; says so plainly where that is absent."""
    if not DATA.is_dir():
        return RealArm(None, ["", f"real arm: skipped, the recording of the Franka Panda is not at {DATA}"])
    answer = identify(LinksRequest((DATA,), out / "franka_panda", arm=str(URDF))).answer
    groups = answer["identifiability"]
    shown: list[RenderableType] = [
        "",
        "A real arm: the Franka Panda, 7 joints with torque sensors (recorded by Gaz et al. 2019)",
        f"{answer['samples']} samples, band {answer['band']:.3g} Hz: {len(answer['base_parameters'])} base parameters "
        f"and {len(answer['effects'])} joint terms",
        f"{len(groups['alone'])} parameters identifiable alone, {len(groups['combined'])} in combination",
        *residual_tables(answer),
        f"published for least squares on these samples: {PUBLISHED_RELATIVE_ERROR} %",
    ]
    return RealArm(answer, shown)
