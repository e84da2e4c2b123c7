"""Parameter errors beside the Cramér–Rao bound, noise in every channel: one figure an estimator, the worst over the
cases; the whole table is printed beside, and which estimators stay within 1.1 times the bound in which cases.

Root mean square over all parameters of (error / bound) on the direct drive arm, two recordings of ten seconds. A ratio
of one is the best that any unbiased estimator can do; so many runs tell it to about three percent.
"""

from __future__ import annotations

from typing import get_args

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.figure import Figure
from benchmarks.noisy_motion import VISCOUS, Noise, bound, recordings
from config import load_installation
from estimator import LinkOptions, base_parameters, identify_links, load_rigid_body
from estimator.links import Estimator

RUNS = 24
SEEDS = (41, 42)
"""Of the motions; the noise of run k is drawn from (`NOISE_SEED`, k). No choice in the estimators was made on these."""
NOISE_SEED = 2027
WITHIN = 1.1
TORQUE = np.array([1.0, 0.5, 0.3])
CASES = {
    "fine encoder": (TORQUE, 1e-5, 2e-2),
    "tachometer": (TORQUE, 5e-4, 2e-2),
    "coarse": (TORQUE / 2.0, 5e-4, 1e-1),
}
"""Standard deviations: torque N·m, angle rad, velocity rad/s; white at 250 Hz."""
SAMPLING = ((100.0, None), (250.0, 10.0), (1000.0, None))
"""Rates (Hz), and the corner (Hz) of coloured noise."""


def measure() -> list[Figure]:
    installation = load_installation("dda")
    body = load_rigid_body(installation.path.parent / installation.arm.urdf)
    base = base_parameters(body)
    truth = np.concatenate([base.combination @ body.prior(), VISCOUS])
    names: tuple[Estimator, ...] = get_args(Estimator)
    table = Table(
        "noise",
        "rate",
        "colour",
        *names,
        title=f"rms of error / Cramér–Rao bound (intervals that hold, %), {RUNS} runs",
    )
    ratios: dict[str, list[float]] = {name: [] for name in names}
    for case, deviations in CASES.items():
        for rate, corner in SAMPLING:
            noise = Noise(*deviations, corner)
            least = bound(body, SEEDS, rate, noise)
            errors: dict[str, list[np.ndarray]] = {name: [] for name in names}
            held: dict[str, list[np.ndarray]] = {name: [] for name in names}
            for run in range(RUNS):
                measured = recordings(body, SEEDS, rate, noise, np.random.default_rng([NOISE_SEED, run]))
                for name in names:
                    options = LinkOptions(estimator=name, terms=("viscous_friction",), select_terms=False)
                    found = identify_links(body, measured, options)
                    errors[name].append((found.value - truth) / least)
                    low, high = found.interval().T
                    held[name].append((low < truth) & (truth < high))
            cells = []
            for name in names:
                ratio = float(np.sqrt(np.mean(np.square(errors[name]))))
                ratios[name].append(ratio)
                cells.append(f"{ratio:.2f} ({100.0 * np.mean(held[name]):.0f})")
            table.add_row(case, f"{rate:g}", "white" if corner is None else f"to {corner:g} Hz", *cells)
    console = Console(width=160)
    console.print(table)
    for name in names:
        within = sum(ratio <= WITHIN for ratio in ratios[name])
        console.print(f"{name}: within {WITHIN} × the bound in {within} of {len(ratios[name])} cases")
    return [Figure(f"crlb_{name}", max(each), "", "Cramér–Rao bound", 1.0) for name, each in ratios.items()]
