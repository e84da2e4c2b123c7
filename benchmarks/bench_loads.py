"""Tables 3.1 and 3.2 of the thesis again: loads on the stand-in arms' wrists, identified from what came over the wire.

The block of Table 3.1 in its four places on the PUMA, at rest in six poses and in the two-second motion; the bar of
Table 3.2 on the PUMA in that motion and in special test movements, and on the direct drive arm.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.figure import Figure
from config import load_installation
from service.daemon.client import DaemonClient
from service.identification.loads import LoadOutcome, identify
from service.identification.request import LoadForm, LoadRequest
from service.supervision import SupervisedProcess

MASS = 1.106
CENTRE = (0.001, 0.0, 0.047)
BLOCK = (0.0023785, 0.0, 0.0, 0.0004757, 0.0, 0.0023785)
BAR = (0.0244, 0.0, 0.0, 0.0007, 0.0, 0.0242)
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
READY_S = 60.0


def measure() -> list[Figure]:
    """Prints both tables beside the thesis'; the figures are the largest errors."""
    with tempfile.TemporaryDirectory(prefix="etude-loads-") as folder:
        places = [0.0, *(row[0] for row in TABLE_3_1)]
        block = [_identified(Path(folder) / f"block{k}", "puma600", y, BLOCK) for k, y in enumerate(places)]
        puma = _identified(Path(folder) / "bar-puma", "puma600", 0.0, BAR)
        dda = _identified(Path(folder) / "bar-dda", "dda", 0.0, BAR)
    console = Console(width=150, markup=False)
    console.print(_table_3_1(block))
    inertias = {
        "PUMA, all joints": puma["dynamic"],
        "PUMA, special": puma["special"],
        "DDA, all joints": dda["dynamic"],
        "DDA, all motions": dda["all"],
    }
    console.print(_table_3_2(inertias))
    return _figures(block, inertias)


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


def _identified(folder: Path, arm: str, shift_y: float, inertia: Sequence[float]) -> dict[str, LoadOutcome]:
    """The load of Table 3.1's mass on that arm: by rests, by the motion of chapter 3, by special movements, by all."""
    folder.mkdir()
    hidden = folder / "hidden.toml"
    x, y, z = CENTRE
    hidden.write_text(
        f'extends = "{"dda-block" if arm == "dda" else arm}"\n[payload]\nmass_kg = {MASS}\n'
        f"centre_m = [{x}, {y + shift_y}, {z}]\ninertia_kg_m2 = {list(inertia)}\n"
    )
    motions = load_installation(arm).arm.load_identification_motions
    with _brought_up(folder, arm, hidden) as daemon:
        paths = [Path(daemon.call("run", {"motion": motion})["recording"]) for motion in motions]
    by_name = {path.stem: path for path in paths}

    def of(form: LoadForm, *names: str) -> LoadOutcome:
        chosen = tuple(by_name[f"{arm}-load{name}"] for name in names)
        return identify(LoadRequest(chosen, folder / "-".join((form, *names)), form=form))

    return {
        "static": of("static", "-poses"),
        "dynamic": of("differentiated", ""),
        "special": of("differentiated", "-test"),
        "all": of("differentiated", "-poses", "", "-test"),
    }


@contextmanager
def _brought_up(folder: Path, arm: str, hidden: Path) -> Iterator[DaemonClient]:
    # Sockets need a short path.
    with tempfile.TemporaryDirectory(prefix="etude-") as run:
        places = {"ETUDE_RUN": run, "ETUDE_STATE": str(folder)}
        config = str(load_installation(arm).path)
        running = []
        try:
            for command in (["virtual", "--hidden", str(hidden)], ["daemon"]):
                process = SupervisedProcess([*command, "--config", config, "--lockstep"], {**os.environ, **places})
                running.append(process)
                process.wait_ready(READY_S)
            with DaemonClient(Path(run), arm) as daemon:
                yield daemon
        finally:
            for process in reversed(running):
                process.stop()


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
