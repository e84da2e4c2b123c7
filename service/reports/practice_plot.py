"""The learning curve against repeatability, and the torques before and after (the thesis' Figures 6.3 and 6.4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from learner.certificate import Certificate
from learner.practice import Practice, Task
from service.reports.style import ACCENT, MUTED, figure, finish

Array = NDArray[np.float64]
OTHER_COLOURS = ("#edae49", "#00798c", "#5b8e7d", "#8d6a9f")


def plot_practice(
    path: Path, motion: str, joints: Sequence[str], practice: Practice, task: Task, certificate: Certificate
) -> None:
    """Raises InputError when the file cannot be written."""
    n = len(joints)
    fig, axes = figure(n + 2, f"{motion}: practised with the {certificate.operator} operator", shared=False)
    plot_curves(axes[0], {"trial filter" if certificate.admitted else "": [_ratios(practice)]})
    t = np.arange(task.reference.samples) * task.reference.period
    gain = axes[1]
    gain.loglog(certificate.frequencies, np.maximum(certificate.gain, 1e-3), color=ACCENT)
    gain.axhline(1.0, color="black", lw=0.8)
    gain.axvline(certificate.band_hz, color=MUTED, ls="--", lw=1.0, label=f"learnt up to {certificate.band_hz:.3g} Hz")
    gain.set_ylabel("gain of an error,\ntrial to trial")
    gain.set_xlabel("frequency [Hz]")
    gain.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    for i, joint in enumerate(joints):
        axis = axes[i + 2]
        axis.plot(t, task.base[:, i], color=MUTED, ls="--", lw=1.2, label="feedforward by the model")
        axis.plot(t, practice.torque[:, i], color=ACCENT, lw=1.2, label="after practice")
        axis.set_ylabel(f"{joint}\ntorque [N·m]")
        axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    axes[-1].set_xlabel("time [s]")
    finish(fig, path)


def plot_operators(path: Path, title: str, curves: Mapping[str, Sequence[Sequence[float]]]) -> None:
    """Learning curves of several operators in one panel: worst joint's velocity error over repeatability. Each has a
    curve for every time that it was practised anew."""
    fig, axes = figure(1, title)
    plot_curves(axes[0], curves)
    finish(fig, path)


def plot_curves(axis: Any, curves: Mapping[str, Sequence[Sequence[float]]]) -> None:
    """Error over repeatability by trial, 0 being the model's feedforward."""
    colours = (ACCENT, *OTHER_COLOURS)
    for k, (name, repeats) in enumerate(curves.items()):
        for again, ratios in enumerate(repeats):
            label = name if name and not again else None
            axis.semilogy(range(len(ratios)), ratios, marker="o", ms=3, color=colours[k % len(colours)], label=label)
    axis.axhline(1.0, color="black", lw=0.8, label="repeatability")
    axis.yaxis.set_major_formatter("{x:g}")
    axis.yaxis.set_minor_formatter("{x:g}")
    axis.set_ylabel("velocity error RMS\n÷ repeatability")
    axis.xaxis.get_major_locator().set_params(integer=True)
    axis.set_xlabel("practice movements")
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)


def _ratios(practice: Practice) -> list[float]:
    return [float(np.max(x.velocity_error_rms / practice.repeatability.velocity)) for x in practice.lessons]
