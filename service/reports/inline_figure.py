"""Figures inside a page: matplotlib's SVG, small, with text that stays text."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from service.reports.page import Html
from service.reports.style import ACCENT, MUTED, blank

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ACCENT", "INK", "MUTED", "axes_of", "svg"]

INK = "#1d2433"
QUIET = "#5c6879"


def axes_of(width_in: float, height_in: float, rows: int = 1, share_x: bool = False) -> tuple[Figure, list[Any]]:
    """A figure of so many panels, one below the other."""
    fig = blank(width_in, height_in)
    panels = list(fig.subplots(rows, 1, sharex=share_x, squeeze=False)[:, 0])
    for axis in panels:
        axis.tick_params(colors=QUIET, labelsize=8.5, length=0)
        axis.xaxis.label.set_color(QUIET)
        axis.yaxis.label.set_color(QUIET)
        for side in ("left", "bottom"):
            axis.spines[side].set_color("#cfd6e0")
    return fig, panels


def svg(fig: Figure, name: str, description: str) -> Html:
    """The figure as an ``<svg>`` element that reads ``description`` aloud; ``name`` keeps its parts apart from those of
    the page's other figures, and the same figure is the same text.
    """
    from matplotlib import rc_context

    stream = io.StringIO()
    settings = {"svg.fonttype": "none", "svg.hashsalt": name, "font.family": "sans-serif", "font.sans-serif": FONTS}
    with rc_context(settings):
        fig.savefig(stream, format="svg", metadata={"Date": None}, transparent=True, dpi=160)
    text = stream.getvalue()
    body = text[text.index("<svg") :].strip()
    label = Html(description.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;"))
    return Html(body.replace("<svg", f'<svg role="img" aria-label="{label}"', 1))


FONTS = ["DejaVu Sans", "Arial", "Helvetica"]
