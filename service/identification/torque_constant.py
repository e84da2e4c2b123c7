"""Torque constants against the wrist sensor, from recordings with a load and without it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from config import InputError
from estimator.loads import LoadOptions, identify_load
from estimator.loads.entries import entry
from estimator.loads.torque_constant import TorqueGain, torque_gains
from service.identification.load_sources import LoadSources, read_load_sources, with_torques, with_wrench
from service.identification.request import TorqueConstantRequest

Tell = Callable[[str, float], None]


def calibrate(request: TorqueConstantRequest, tell: Tell = lambda stage, share: None) -> dict[str, Any]:
    """The answer of ``calibrate torque-constant``: the load by its wrench, then each joint's gain by the load.

    Raises InputError for recordings without wrench or torque, of another arm, or with too little motion.
    """
    loaded = {path.resolve() for path in request.recordings}
    for path in request.without:
        if path.resolve() in loaded:
            raise InputError(str(path), "is both loaded and without the load", "give a recording of its own")
    tell("reading", 0.0)
    read = read_load_sources(request, [*request.recordings, *request.without])
    count = len(request.recordings)
    tell("weighing the load", 0.3)
    options = LoadOptions(
        offset="constant" if count == 1 else "each", band_hz=request.band_hz, sensor_range=read.sensor_range
    )
    weighed = identify_load(read.body, read.frame, [with_wrench(read, k) for k in range(count)], options=options)
    tell("comparing the torques", 0.6)
    with_load, free, doubts = with_torques(read, count)
    gains = torque_gains(read.body, read.frame, weighed.load, with_load, free, request.band_hz)
    tell("done", 1.0)
    untold = [g.joint for g in gains if not np.isfinite(g.gain)]
    warnings = [f"the load hardly reaches {', '.join(untold)}: move it there, or take a heavier one"] if untold else []
    if count == 1:
        warnings.append(
            "one motion alone may confuse a gain with what friction does under load, which the errors do not hold: "
            "give several, slow poses among them"
        )
    return {
        "arm": read.arm.name,
        "joints": {g.joint: _entry(g, read) for g in gains},
        "load": {"mass": entry(weighed.load.mass, "kg", held=weighed.rigid.verdict == "not rigid")},
        "status": "calibrated" if len(untold) < len(gains) else "too little torque",
        "notes": list(read.notes),
        "warnings": [*doubts, *weighed.all_warnings, *warnings],
    }


def _entry(found: TorqueGain, read: LoadSources) -> dict[str, Any]:
    """With what the installation's ``rated_torque_nm`` should be, where there is an installation."""
    installation = read.recordings[0].installation or read.arm.installation
    rated = None
    if installation is not None:
        rated = {j.name: j.rated_torque_nm for j in installation.joint}[found.joint]
    return {
        "gain": {"value": found.gain, "standard_error": found.standard_error, "unit": ""},
        "rated_torque_nm": {
            "value": None if rated is None else rated * found.gain,
            "standard_error": None if rated is None else rated * found.standard_error,
            "unit": "N·m",
        },
        "load_torque_rms": found.load_torque_rms,
    }
