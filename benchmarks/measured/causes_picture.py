"""``docs/pictures/causes.png``: causes that were named in recordings of real machines, each with its law."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimator.diagnosis.telling.answer import Diagnosis, Finding
from estimator.diagnosis.telling.traces import Signature
from service.reports.style import ACCENT, finish

PICTURE = Path(__file__).parents[2] / "docs" / "pictures" / "causes.png"


def draw(panels: Sequence[tuple[str, Diagnosis]]) -> Path:
    """The first finding of each diagnosis, side by side under its title: what was measured, less everything else that
    was found, and the law over it. Returns the picture's path."""
    fig = Figure(figsize=(11.0, 4.0), layout="constrained")
    for axis, (title, diagnosis) in zip(fig.subplots(1, len(panels)), panels, strict=True):
        _signature(axis, title, diagnosis.findings[0], diagnosis.traces.signatures[0])
    finish(fig, PICTURE)
    return PICTURE


def _signature(axis: Axes, title: str, finding: Finding, signature: Signature) -> None:
    axis.plot(
        signature.x, signature.measured, ".", color="#9aa8ba", ms=4.0, alpha=0.45, label="measured, less the rest"
    )
    along = np.argsort(signature.curve_x)
    axis.plot(signature.curve_x[along], signature.curve[along], color=ACCENT, lw=2.2, label="the law that was named")
    axis.set_title(f"{title}: {finding.effect.replace('_', ' ')}", loc="left", fontsize=10, fontweight="bold")
    axis.set_xlabel(f"{signature.quantity} [{signature.unit}]")
    axis.set_ylabel(f"{signature.channel} [{signature.channel_unit}]")
    axis.legend(loc="upper left", bbox_to_anchor=(0.0, -0.13), ncols=2, frameon=False, fontsize=8.5)
