"""A load from the joint torques of loaded and free recordings, as an answer like that from wrenches."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from estimator.loads import RigidLoad
from estimator.loads.entries import load_entries, load_warnings
from estimator.loads.from_torques import TorqueLoad, load_from_torques
from service.identification.load_sources import LoadSources, with_torques
from service.identification.request import LoadRequest
from service.reports.load_plot import plot_torque_difference

UNTESTED = "joint torques hold the arm's own errors too: they cannot tell whether a load is rigid"


@dataclass(frozen=True)
class TorqueOutcome:
    load: RigidLoad
    answer: dict[str, Any]


def from_torques(request: LoadRequest, read: LoadSources) -> TorqueOutcome:
    """Raises InputError for a recording without torques, or of other joints."""
    loaded, free, doubts = with_torques(read, len(request.recordings))
    found = load_from_torques(read.body, read.frame, loaded, free, request.band_hz)
    plot = request.directory / "torques.png"
    title = f"{read.arm.name}: torques of the load in {Path(read.sources[0].path).stem}"
    plot_torque_difference(plot, title, read.body.joints, found.histories[0])
    return TorqueOutcome(found.load, {**_answer(found, read, doubts), "plot": str(plot)})


def _answer(found: TorqueLoad, read: LoadSources, doubts: list[str]) -> dict[str, Any]:
    rms, power = np.sqrt(found.fit.autocovariance[:, 0]), np.sqrt(found.fit.power)
    return {
        **load_entries(found.load, held=False),
        "wrench_residual": None,
        "torque_residual": {
            joint: {"rms": float(r), "relative": float(r / p) if p > 0.0 else 0.0}
            for joint, r, p in zip(read.body.joints, rms, power, strict=True)
        },
        "rigid": {"verdict": "untested", "p_value": None, "noise_from": "nothing", "detectable_share": None},
        "offset": None,
        "drift": None,
        "wrench_delay": None,
        "paired_with": list(found.paired),
        "errors_widened_by": found.widening,
        "samples": found.samples,
        "rows": found.rows,
        "band_hz": found.band,
        "form": "differentiated",
        "status": "identified" if np.isfinite(found.load.parameters).all() else "too little motion",
        "warnings": [*doubts, *found.warnings, *load_warnings(found.load), UNTESTED],
        "hold_out": None,
    }
