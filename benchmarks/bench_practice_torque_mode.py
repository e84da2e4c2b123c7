"""Practice with the controller in the loop (CST, PD and feedforward) of Table 6.1's motion on the stand-in direct drive
arm, through the wire: the worst joint's velocity error over its repeatability, with the model's feedforward and after
three practice movements."""

from __future__ import annotations

from benchmarks.bench_practice import MOTION, ratios, up
from benchmarks.figure import Figure

TRIALS = 3


def measure() -> list[Figure]:
    with up(0) as daemon:
        model = daemon.call("identify_links")["model"]
        asked = {"motion": MOTION, "model": model, "trials": TRIALS, "mode": "cst"}
        curve = ratios(daemon.call("practise", asked))
    return [
        Figure("practice_first (cst)", curve[0], "× repeatability", "", None),
        Figure("practice_third (cst)", min(curve[1:]), "× repeatability", "the bound", 1.5),
        Figure("practice_last (cst)", curve[-1], "× repeatability", "the first trial", curve[0]),
    ]
