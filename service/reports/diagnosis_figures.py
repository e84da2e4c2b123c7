"""The figures that make a diagnosis believable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.telling.traces import Signature, Traces
from service.reports.inline_figure import ACCENT, INK, MUTED, axes_of, svg
from service.reports.page import Html

Array = NDArray[np.float64]

BINS = 60
"""At most; fewer where there are few samples."""
FEWEST = 4
"""Samples that a bin needs to be drawn."""
POINTS = 4000
"""Samples drawn of a cloud or a curve; the eye sees no more."""
NEAR = 3.0
"""Nats: nearer alternatives are as good as the finding."""


def signature_figure(number: int, signature: Signature) -> Html:
    """What one finding explains, against what it depends on: cloud, mean of the cloud, and the law over it."""
    fig, (axis,) = axes_of(6.4, 4.2)
    step = max(1, len(signature.x) // POINTS)
    cloud = (signature.x[::step], signature.measured[::step])
    axis.plot(*cloud, ".", color="#9aa8ba", ms=3.0, alpha=0.5, rasterized=True, label="measured, less the rest")
    axis.plot(*binned(signature.x, signature.measured), "o", color=INK, ms=3.6, label="its mean", zorder=3)
    axis.plot(*binned(signature.curve_x, signature.curve), color=ACCENT, lw=2.2, label="the law", zorder=4)
    low, high = np.quantile(signature.measured, [0.005, 0.995])
    room = 0.12 * max(high - low, 1e-12)
    axis.set_ylim(low - room, high + room)
    axis.set_xlabel(f"{signature.quantity} [{signature.unit}]")
    axis.set_ylabel(f"{signature.channel} [{signature.channel_unit}]")
    axis.legend(loc="upper left", bbox_to_anchor=(0.0, 1.13), ncols=3, frameon=False, fontsize=8.5, handlelength=1.4)
    return svg(fig, f"signature-{number}", f"{signature.channel} against {signature.quantity}, with the fitted law")


def binned(x: Array, y: Array) -> tuple[Array, Array]:
    """Mean of ``x`` and of ``y`` in equal bins over ``x``, those that have samples enough."""
    low, high = np.quantile(x, [0.002, 0.998])
    bins = int(np.clip(len(x) // 20, 8, BINS))
    k = np.digitize(x, np.linspace(low, high, bins + 1)) - 1
    inside = (k >= 0) & (k < bins)
    count = np.bincount(k[inside], minlength=bins)
    kept = count >= FEWEST
    means = [np.bincount(k[inside], weights=values[inside], minlength=bins)[kept] / count[kept] for values in (x, y)]
    return means[0], means[1]


def alternatives_figure(number: int, label: str, alternatives: Sequence[Mapping[str, Any]]) -> Html:
    """How far behind the finding each alternative is, in nats, on a scale that shows near and far ones."""
    names = [label, *(_name(a) for a in alternatives)]
    gaps = np.array([0.0, *(max(0.0, float(a["log_likelihood_gap"])) for a in alternatives)])
    fig, (axis,) = axes_of(4.3, 0.75 + 0.42 * len(names))
    rows = np.arange(len(names))
    length = np.log10(1.0 + gaps)
    axis.axvspan(0.0, np.log10(1.0 + NEAR), color="#fdf3dc", lw=0)
    axis.barh(rows, np.maximum(length, 0.015), height=0.34, color=[ACCENT, *[MUTED] * len(alternatives)])
    for row, name, gap, end in zip(rows, names, gaps, length, strict=True):
        axis.text(0.0, row - 0.24, name, fontsize=8.5, color=INK, va="bottom", weight="bold" if row == 0 else "normal")
        if row:
            axis.text(
                end + 0.04, row, f"{gap:.0f}" if gap >= 100.0 else f"{gap:.2g}", fontsize=8.5, color=INK, va="center"
            )
    axis.set_ylim(len(names) - 0.5, -0.75)
    axis.set_xlim(0.0, max(float(length.max()) * 1.18, 1.2))
    axis.set_yticks([])
    ticks = [t for t in (0, 3, 10, 100, 1000, 10_000, 100_000) if np.log10(1 + t) <= axis.get_xlim()[1]]
    axis.set_xticks(np.log10(1.0 + np.array(ticks)), [f"{t:g}" for t in ticks])
    axis.set_xlabel("nats behind")
    axis.spines["left"].set_visible(False)
    axis.grid(axis="y", visible=False)
    return svg(fig, f"alternatives-{number}", "how far behind the alternatives are")


def residual_figure(traces: Traces, units: Mapping[str, str], found: bool = True) -> Html:
    """Torque residual over time, before and after, one panel a joint, with a band of twice the noise.

    ``units`` of the torque, by joint. ``found``: whether the second curve has findings, or the given model's links only
    moved within their tolerance.
    """
    joints = len(units)
    fig, panels = axes_of(10.4, 0.7 + 1.15 * joints, joints, share_x=True)
    step = max(1, len(traces.t) // POINTS)
    for i, (axis, (joint, unit)) in enumerate(zip(panels, units.items(), strict=True)):
        noise = 2.0 * float(traces.noise[i])
        axis.axhspan(-noise, noise, color="#e8eef6", lw=0, label="± 2 noise")
        axis.plot(traces.t[::step], traces.before[::step, i], color=MUTED, lw=0.9, label="given model")
        axis.plot(
            traces.t[::step],
            traces.after[::step, i],
            color=ACCENT,
            lw=0.9,
            label="with the findings" if found else "links within their tolerance",
        )
        axis.set_ylabel(f"{joint}\n[{unit}]")
        limit = 1.15 * float(np.nanquantile(np.abs(traces.before[:, i]), 0.998)) + noise
        axis.set_ylim(-limit, limit)
        axis.margins(x=0.005)
    panels[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False, fontsize=8.5)
    panels[-1].set_xlabel("time [s]")
    return svg(fig, "residual", "torque residual of each joint over time, before and after")


def _name(alternative: Mapping[str, Any]) -> str:
    where = alternative["joint"] or (f"{alternative['channel']} channel" if alternative.get("channel") else "arm")
    return f"{str(alternative['effect']).replace('_', ' ')} · {where}"
