"""How Étude's figures look: one panel below another over a shared time axis, quiet colours, no screen needed."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from config import InputError

ACCENT = "#d1495b"
MUTED = "#7d8ca3"
DPI = 150

matplotlib.rcParams.update(
    {
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": "#e6e8ec",
        "grid.linewidth": 0.7,
        "axes.axisbelow": True,
    }
)


def figure(panels: int, title: str, *, shared: bool = True) -> tuple[Figure, list[Any]]:
    """A figure of that many panels, over a ``shared`` horizontal axis or each over its own.

    Made without pyplot: no state, no display.
    """
    fig = Figure(figsize=(11.0, 0.9 + 1.9 * panels), layout="constrained")
    axes = fig.subplots(panels, 1, sharex=shared, squeeze=False)[:, 0]
    fig.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
    return fig, list(axes)


def finish(fig: Figure, path: Path) -> None:
    """Write the figure as PNG, atomically. Raises InputError when that cannot be done."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        fig.savefig(draft, dpi=DPI, format="png")
        draft.replace(path)
    except OSError as error:
        raise InputError(str(path), f"the plot cannot be written ({error.strerror})", "check the directory") from None
