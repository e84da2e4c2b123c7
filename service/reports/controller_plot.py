"""Tracking errors of the controllers over the motion, as Figures 2 and 3 of Appendix A have them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType
from rich.table import Table

from config.motion import SampledMotion
from service.practice.controllers import Variant
from service.reports.style import ACCENT, figure, finish

Array = NDArray[np.float64]
COLOURS = ("#c9cdd3", "#8d99ae", "#edae49", "#00798c", ACCENT, "black", "#5b8e7d", "#8d6a9f")


def plot_controllers(
    path: Path, motion: SampledMotion, joints: Sequence[str], errors: Sequence[tuple[Variant, Array]]
) -> None:
    """Two panels a joint: hybrid and digital controllers. Raises InputError when the file cannot be written.

    A controller without a velocity reference leaves the range of the others, as it does in the thesis.
    """
    fig, axes = figure(2 * len(joints), f"{motion.name}: tracking errors of the controllers of Appendix A")
    for i, joint in enumerate(joints):
        for panel, family in enumerate(("hybrid", "digital")):
            axis = axes[2 * i + panel]
            shown = [(v, e) for v, e in errors if v.family == family]
            bounded = [np.abs(e[:, i]).max() for v, e in shown if not v.name.startswith("position reference")]
            for k, (variant, error) in enumerate(shown):
                label = variant.name if family == "hybrid" else f"{variant.name}, {variant.rate_hz:.0f} Hz"
                axis.plot(motion.t, np.rad2deg(error[:, i]), color=COLOURS[k % len(COLOURS)], lw=1.2, label=label)
            reach = 1.15 * np.rad2deg(max(bounded, default=0.0)) or 1.0
            axis.set_ylim(-reach, reach)
            axis.set_ylabel(f"{joint}, {family}\nerror [°]")
            axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False, fontsize=7)
    axes[-1].set_xlabel("time [s]")
    finish(fig, path)


def controller_report(answer: dict[str, Any]) -> list[RenderableType]:
    """Peak errors of all controllers, for a person."""
    joints = list(answer["controllers"][0]["peak_deg"])
    table = Table("controller", "rate [Hz]", *(f"{joint}, peak [°]" for joint in joints), box=None)
    for row in answer["controllers"]:
        name = f"{row['family']}: {row['controller']}" + ("" if row["played"] else " (not played: its lag)")
        table.add_row(name, f"{row['rate_hz']:.0f}", *(f"{row['peak_deg'][joint]:.3g}" for joint in joints))
    return [f"{answer['motion']}, by {answer['model']}", table, *answer["findings"], f"plot: {answer['plot']}"]
