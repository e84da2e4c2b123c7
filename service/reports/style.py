"""How Étude's figures look: one panel below another over a shared time axis, quiet colours, no screen needed.

matplotlib is loaded when the first figure is made: a third of what the daemon's start would take otherwise.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config import InputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ACCENT = "#d1495b"
MUTED = "#7d8ca3"
DPI = 150

_LOOK = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e8ec",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
}


def blank(width_in: float, height_in: float) -> Figure:
    """An empty figure in Étude's looks, made without pyplot: no state, no display."""
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams.update(_LOOK)
    return Figure(figsize=(width_in, height_in), layout="constrained")


def figure(panels: int, title: str, *, shared: bool = True) -> tuple[Figure, list[Any]]:
    """A figure of that many panels, over a ``shared`` horizontal axis or each over its own."""
    fig = blank(11.0, 0.9 + 1.9 * panels)
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
