"""Tables 3.1 and 3.2 of the thesis again: loads on the stand-in arms' wrists, identified from what came over the wire.

The block of Table 3.1 in its four places on the PUMA, at rest in six poses and in the two-second motion; the bar of
Table 3.2 on the PUMA in that motion and in special test movements, and on the direct drive arm. Then chapter 3's own
least squares, differentiated and integrated, beside the optimal filter on the same recordings; each with other noise,
since one recording does not tell which is better.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.chapter3 import plain_estimate
from benchmarks.figure import Figure
from benchmarks.loaded_arm import BAR, BLOCK, CENTRE, MASS, recorded
from estimator.loads import RigidLoad, identify_load, rigid_load
from estimator.loads.rows import Form
from service.identification.load_sources import read_load_sources, with_wrench
from service.identification.loads import LoadOutcome, identify
from service.identification.request import LoadForm, LoadRequest

Array = NDArray[np.float64]

TABLE_3_1 = (
    (0.037, 1.103, 0.037, 1.067, 0.039),
    (-0.043, 1.107, -0.043, 1.084, -0.042),
    (-0.021, 1.100, -0.020, 1.073, -0.021),
    (0.018, 1.099, 0.018, 1.074, 0.020),
)
"""True change of the centre's y [m]; mass [kg] and that change by the static estimate, and by the dynamic one."""
TABLE_3_2 = {
    "PUMA, all joints": (0.0192, -0.0048, 0.0019, 0.0021, -0.0016, 0.0176),
    "PUMA, special": (0.0246, 0.0006, 0.0008, 0.0036, -0.0004, 0.0199),
    "DDA, all joints": (0.0230, 0.0006, 0.0005, -0.0002, -0.0002, 0.0241),
}
"""kg·m²: 11, 12, 13, 22, 23, 33 as the thesis estimated them."""
CUT_OFF_HZ = {"puma600": 33.0, "dda": 30.0}
"""Chapter 3's, for differentiation."""
SENSOR_SEED = 3
"""Of the noise, with and without the sensor's give."""
WAYS: tuple[tuple[str, Form | None], ...] = (
    ("differentiated", "differentiated"),
    ("integrated", "integrated"),
    ("optimally filtered", None),
)


def measure() -> list[Figure]:
    """Prints the tables beside the thesis'; the figures are the largest errors."""
    places = [0.0, *(row[0] for row in TABLE_3_1)]
    block = [_identified("puma600", y, BLOCK, seed) for seed, y in enumerate(places)]
    puma = _identified("puma600", 0.0, BAR, len(places))
    dda = _identified("dda", 0.0, BAR, 0)
    console = Console(width=150, markup=False)
    console.print(_table_3_1(block))
    inertias = {
        "PUMA, all joints": puma["dynamic"],
        "PUMA, special": puma["special"],
        "DDA, all joints": dda["dynamic"],
        "DDA, all motions": dda["all"],
    }
    console.print(_table_3_2(inertias))
    compared = [
        Compared("puma600", "-load", [(y, BLOCK) for y in places], range(len(places))),
        Compared("puma600", "-load-test", [(y, BLOCK) for y in places], range(len(places))),
        Compared("dda", "-load", [(0.0, BAR)], range(1)),
    ]
    errors = [c.errors() for c in compared]
    console.print(_ways(compared, errors))
    gives, stiff = (
        _identified("dda", 0.0, BLOCK, SENSOR_SEED, compliant=compliant)["all"].load.mass for compliant in (True, False)
    )
    for sensor, mass in (("that gives at 35 Hz", gives), ("that does not", stiff)):
        beyond, error = 1e3 * (float(mass.value) - MASS), 1e3 * float(mass.standard_error)
        console.print(f"block on the DDA, on a sensor {sensor}: {beyond:+.2f} ± {error:.2f} g, in the same noise")
    heavier = 1e3 * float(gives.value - stiff.value)
    given = Figure("load_sensor_gives_mass", heavier, "g", "standard error", 1e3 * float(gives.standard_error))
    return [*_figures(block, inertias), *_better(compared, errors), given]


@dataclass(frozen=True)
class Compared:
    """One motion of one arm with each of these true loads, each with the noise of its seed."""

    arm: str
    motion: str
    loads: Sequence[tuple[float, tuple[float, ...]]]
    seeds: Sequence[int]

    def errors(self) -> Array:
        """(ways, 3): rms over the recordings of the errors of mass kg, centre m, inertia kg·m²."""
        squares = []
        for (y, inertia), seed in zip(self.loads, self.seeds, strict=True):
            path = recorded(self.arm, inertia, y, seed=seed)[self.motion]
            read = read_load_sources(LoadRequest((path,), path.parent), (path,))
            recording = [with_wrench(read, 0)]
            found = [
                identify_load(read.body, read.frame, recording).load
                if form is None
                else plain_estimate(read.body, read.frame, recording, form, CUT_OFF_HZ[self.arm])
                for _, form in WAYS
            ]
            squares.append([_squares(load, y, inertia) for load in found])
        return np.asarray(np.sqrt(np.mean(squares, axis=0)))


def _squares(load: RigidLoad, y: float, inertia: tuple[float, ...]) -> list[float]:
    true = rigid_load(MASS, np.array(CENTRE) + [0.0, y, 0.0], np.array(inertia))
    pairs = ((load.mass, true.mass), (load.centre, true.centre), (load.inertia, true.inertia))
    return [float(np.mean((found.value - right.value) ** 2)) for found, right in pairs]


def _ways(compared: Sequence[Compared], errors: Sequence[Array]) -> Table:
    table = Table(title="One motion, rms errors: chapter 3 and optimal filters", title_justify="left", box=None)
    for heading in ("", "recordings", *(f"{way}: g, mm, g·m²" for way, _ in WAYS)):
        table.add_column(heading, justify="right" if heading else "left")
    for c, error in zip(compared, errors, strict=True):
        cells = [", ".join(f"{1e3 * x:.2f}" for x in row) for row in error]
        table.add_row(f"{c.arm}{c.motion}", str(len(c.loads)), *cells)
    return table


def _better(compared: Sequence[Compared], errors: Sequence[Array]) -> list[Figure]:
    return [
        Figure(f"load_inertia_{c.arm}{c.motion}_optimal", 1e3 * e[2, 2], "g·m²", "differentiated", 1e3 * e[0, 2])
        for c, e in zip(compared, errors, strict=True)
    ]


def _figures(block: Sequence[dict[str, LoadOutcome]], inertias: dict[str, LoadOutcome]) -> list[Figure]:
    figures = []
    for how, column, most in (("static", 1, (10.0, 1.0)), ("dynamic", 3, (40.0, 2.0))):
        mass = max(abs(float(b[how].load.mass.value) - MASS) for b in block)
        theirs = max(abs(row[column] - MASS) for row in TABLE_3_1)
        figures.append(Figure(f"load_{how}_mass", 1e3 * mass, "g", f"thesis, within {most[0]:g} g", 1e3 * theirs))
        shift = max(
            float(np.abs(b[how].load.centre.value - np.array(CENTRE) - [0.0, y, 0.0]).max())
            for b, y in zip(block, [0.0, *(row[0] for row in TABLE_3_1)], strict=True)
        )
        theirs = max(abs(row[column + 1] - row[0]) for row in TABLE_3_1)
        figures.append(Figure(f"load_{how}_centre", 1e3 * shift, "mm", f"thesis, within {most[1]:g} mm", 1e3 * theirs))
    for name, estimates in TABLE_3_2.items():
        error = float(np.abs(inertias[name].load.inertia.value - BAR).max())
        theirs = float(np.abs(np.array(estimates) - BAR).max())
        label = name.lower().replace(", ", "_").replace(" ", "_")
        figures.append(Figure(f"load_inertia_{label}", 1e3 * error, "g·m²", "thesis", 1e3 * theirs))
    return figures


def _identified(
    arm: str, shift_y: float, inertia: tuple[float, ...], seed: int, *, compliant: bool = True
) -> dict[str, LoadOutcome]:
    """The load of Table 3.1's mass on that arm: by rests, by the motion of chapter 3, by special movements, by all."""
    by_name = recorded(arm, inertia, shift_y, seed=seed, compliant=compliant)

    def of(form: LoadForm, *names: str) -> LoadOutcome:
        with tempfile.TemporaryDirectory(prefix="etude-load-") as folder:
            return identify(LoadRequest(tuple(by_name[name] for name in names), Path(folder), form=form))

    return {
        "static": of("static", "-load-poses"),
        "dynamic": of("differentiated", "-load"),
        "special": of("differentiated", "-load-test"),
        "all": of("differentiated", *by_name),
    }


def _table_3_1(block: Sequence[dict[str, LoadOutcome]]) -> Table:
    table = Table(title="Table 3.1: block on the PUMA 600", title_justify="left", box=None)
    for heading in ("", "true", "static", "± std. error", "thesis", "dynamic", "± std. error", "thesis"):
        table.add_column(heading, justify="right" if heading else "left")
    reference = block[0]
    for row, found in zip(TABLE_3_1, block[1:], strict=True):
        masses, changes = [], []
        for how in ("static", "dynamic"):
            load, origin = found[how].load, reference[how].load
            change = float(load.centre.value[1] - origin.centre.value[1])
            error = float(np.hypot(load.centre.standard_error[1], origin.centre.standard_error[1]))
            masses += [f"{float(load.mass.value):.4f}", f"{float(load.mass.standard_error):.4f}"]
            changes += [f"{change:.4f}", f"{error:.4f}"]
        y, *theirs = row
        table.add_row("mass [kg]", f"{MASS:.3f}", *masses[:2], f"{theirs[0]:.3f}", *masses[2:], f"{theirs[2]:.3f}")
        table.add_row(
            "change of c_y [m]", f"{y:.3f}", *changes[:2], f"{theirs[1]:.3f}", *changes[2:], f"{theirs[3]:.3f}"
        )
    return table


def _table_3_2(inertias: dict[str, LoadOutcome]) -> Table:
    table = Table(title="Table 3.2: moments of inertia of the bar [kg·m²]", title_justify="left", box=None)
    table.add_column("")
    table.add_column("true", justify="right")
    for name in inertias:
        table.add_column(name, justify="right")
        if name in TABLE_3_2:
            table.add_column("thesis", justify="right")
    for k, (row, true) in enumerate(zip(("I11", "I12", "I13", "I22", "I23", "I33"), BAR, strict=True)):
        cells = []
        for name, outcome in inertias.items():
            found = outcome.load.inertia
            cells.append(f"{found.value[k]:.4f} ± {found.standard_error[k]:.4f}")
            if name in TABLE_3_2:
                cells.append(f"{TABLE_3_2[name][k]:.4f}")
        table.add_row(row, f"{true:.4f}", *cells)
    return table
