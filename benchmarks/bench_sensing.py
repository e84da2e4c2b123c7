"""Wrist sensing against joint sensing, with and without tachometers: the bar of Table 3.2 on the direct drive arm.

One set of recordings tells all four: the load by the wrist sensor's wrench, or by the joints' torques beyond those of
the same motions played free; with the tachometers' velocities, or with the angles alone, differentiated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.figure import Figure
from benchmarks.loaded_arm import BAR, CENTRE, MASS, NOTHING, recorded
from estimator.loads import RigidLoad, identify_load
from estimator.loads.from_torques import load_from_torques
from estimator.loads.parameters import Measured
from estimator.trajectory import Trajectory
from service.identification.load_sources import LoadSources, read_load_sources, with_torques, with_wrench
from service.identification.request import LoadRequest

ARM = "dda"


def measure() -> list[Figure]:
    """Prints errors and standard errors of the four; the figures set each beside the wrist with tachometers."""
    loaded, free = (tuple(recorded(ARM, inertia).values()) for inertia in (BAR, NOTHING))
    read = read_load_sources(LoadRequest(loaded, loaded[0].parent), (*loaded, *free))
    found = {
        f"{place}, {'tachometers' if tachometers else 'angles alone'}": sense(read, len(loaded), tachometers)
        for place, sense in (("wrist", _by_wrench), ("joints", _by_torques))
        for tachometers in (True, False)
    }
    true = (np.array(MASS), np.array(CENTRE), np.array(BAR))
    table = Table(title="Largest error ± largest standard error", title_justify="left", box=None)
    for heading in ("", "mass [g]", "centre [mm]", "inertia [g·m²]"):
        table.add_column(heading, justify="right" if heading else "left")
    for name, load in found.items():
        told = zip((load.mass, load.centre, load.inertia), true, strict=True)
        table.add_row(name, *(_cell(measured, right) for measured, right in told))
    Console(width=120, markup=False).print(table)
    best = _error(next(iter(found.values())))
    labels = {name: "sensing_mass_" + name.replace(", ", "_").replace(" ", "_") for name in found}
    return [Figure(labels[name], _error(load), "g", "wrist, tachometers", best) for name, load in found.items()]


def _by_wrench(read: LoadSources, loaded: int, tachometers: bool) -> RigidLoad:
    recordings = [with_wrench(read, number) for number in range(loaded)]
    motions = _seen([recording.motion for recording in recordings], tachometers)
    recordings = [replace(recording, motion=motion) for recording, motion in zip(recordings, motions, strict=True)]
    return identify_load(read.body, read.frame, recordings).load


def _by_torques(read: LoadSources, loaded: int, tachometers: bool) -> RigidLoad:
    with_load, free, _ = with_torques(read, loaded)
    return load_from_torques(read.body, read.frame, _seen(with_load, tachometers), _seen(free, tachometers)).load


def _seen(motions: Sequence[Trajectory], tachometers: bool) -> list[Trajectory]:
    return [motion if tachometers else replace(motion, dq=None) for motion in motions]


def _error(load: RigidLoad) -> float:
    return 1e3 * abs(float(load.mass.value) - MASS)


def _cell(measured: Measured, right: np.ndarray) -> str:
    if not np.isfinite(measured.value).all():
        return "not told"
    error = 1e3 * float(np.abs(measured.value - right).max())
    return f"{error:.2f} ± {1e3 * float(np.max(measured.standard_error)):.2f}"
