"""Recordings of the stand-in arms with and without a load on the wrist, as they came over the wire."""

from __future__ import annotations

import atexit
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from config import load_installation
from service.daemon.client import DaemonClient
from service.supervision import SupervisedProcess

MASS = 1.106
CENTRE = (0.001, 0.0, 0.047)
BLOCK = (0.0023785, 0.0, 0.0, 0.0004757, 0.0, 0.0023785)
BAR = (0.0244, 0.0, 0.0, 0.0007, 0.0, 0.0242)
"""kg, m, kg·m² (xx xy xz yy yz zz about the centre): the block of Table 3.1 and the bar of Table 3.2."""
NOTHING = (0.0,) * 6
READY_S = 60.0
MOTIONS = ("-load-poses", "-load", "-load-test")
"""Names behind the arm's: rests, the motion of chapter 3, special test movements."""
_COMPLIANCE = """
[[wrench_sensor]]
sensor = "wrist"
bias = [2.4, -1.1, 3.6, 0.05, -0.08, 0.03]
drift_per_s = [0.002, 0.003, -0.002, 0.0, 0.0, 0.0]
compliance = []
"""


@cache
def recorded(
    arm: str,
    inertia: tuple[float, ...],
    shift_y: float = 0.0,
    *,
    seed: int = 0,
    compliant: bool = True,
    motions: tuple[str, ...] = MOTIONS,
) -> dict[str, Path]:
    """One recording of each of the ``motions``, under its name; kept until the process ends.

    The load has `MASS` at `CENTRE` (``shift_y`` m along y); with ``inertia`` `NOTHING` there is none. ``seed``: of the
    noise. ``compliant``: whether the direct drive arm's sensor gives under the load.
    """
    folder = Path(tempfile.mkdtemp(prefix="etude-loads-", dir=_kept()))
    x, y, z = CENTRE
    hidden = folder / "hidden.toml"
    if inertia == NOTHING:
        hidden.write_text(f'extends = "{arm}"\n')
    else:
        base = f'extends = "{"dda-block" if arm == "dda" else arm}"\n' if compliant else f'extends = "{arm}"\n'
        payload = (
            f"[payload]\nmass_kg = {MASS}\ncentre_m = [{x}, {y + shift_y}, {z}]\ninertia_kg_m2 = {list(inertia)}\n"
        )
        hidden.write_text(base + payload + ("" if compliant else _COMPLIANCE))
    with _brought_up(folder, arm, hidden, seed) as daemon:
        return {name: Path(daemon.call("run", {"motion": f"{arm}{name}"})["recording"]) for name in motions}


@cache
def _kept() -> str:
    folder = tempfile.TemporaryDirectory(prefix="etude-loads-")
    atexit.register(folder.cleanup)
    return folder.name


@contextmanager
def _brought_up(folder: Path, arm: str, hidden: Path, seed: int) -> Iterator[DaemonClient]:
    # Sockets need a short path.
    with tempfile.TemporaryDirectory(prefix="etude-") as run:
        places = {"ETUDE_RUN": run, "ETUDE_STATE": str(folder)}
        config = str(load_installation(arm).path)
        running = []
        try:
            for command in (["virtual", "--hidden", str(hidden), "--seed", str(seed)], ["daemon"]):
                process = SupervisedProcess([*command, "--config", config, "--lockstep"], {**os.environ, **places})
                running.append(process)
                process.wait_ready(READY_S)
            with DaemonClient(Path(run), arm) as daemon:
                yield daemon
        finally:
            for process in reversed(running):
                process.stop()
