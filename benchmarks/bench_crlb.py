"""Parameter errors beside the Cramér–Rao bound, noise in every channel: one figure an estimator, the worst over the
cases; the whole table is printed beside, and which estimators stay within 1.1 times the bound in which cases.

Direct drive arm, two recordings of ten seconds. An error is the root mean square over all parameters and runs, each in
units of its bound, over that of an estimator that attains the bound in the same noise: a ratio of one is the best that
any unbiased estimator can do, and few runs tell it. Printed with it is its Monte Carlo error (jackknife over runs).
"""

from __future__ import annotations

from typing import get_args

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.figure import Figure
from benchmarks.noisy_motion import VISCOUS, Bound, Noise, measured
from config import load_installation
from estimator import LinkOptions, base_parameters, identify_links, load_rigid_body
from estimator.links import Estimator

RUNS = 10
SEEDS = (41, 42)
"""Of the motions; the noise of run k is drawn from (`NOISE_SEED`, k). No choice in the estimators was made on these."""
NOISE_SEED = 2027
WITHIN = 1.1
NORMAL_95 = 1.96
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
    table = Table("noise", "rate", "colour", "attains", *(name.replace("_", " ") for name in names))
    table.title = f"rms error / that of who attains the Cramér–Rao bound, ± Monte Carlo error ({RUNS} runs)"
    table.caption = (
        "in brackets, and of who attains the bound: intervals of 95 % that hold the truth, %, where they are given"
    )
    ratios: dict[str, list[float]] = {name: [] for name in names}
    held: dict[str, list[float]] = {name: [] for name in names}
    for case, deviations in CASES.items():
        for rate, corner in SAMPLING:
            noise = Noise(*deviations, corner)
            bound = Bound(body, SEEDS, noise)
            least = bound.standard_error
            best: list[float] = []
            known: list[float] = []
            squares: dict[str, list[float]] = {name: [] for name in names}
            inside: dict[str, list[float]] = {name: [] for name in names}
            for run in range(RUNS):
                seen = measured(body, SEEDS, rate, noise, np.random.default_rng([NOISE_SEED, run]))
                attained = bound.attained(seen.noise) / least
                best.append(float(np.mean(attained**2)))
                known.append(100.0 * float(np.mean(np.abs(attained) < NORMAL_95)))
                for name in names:
                    options = LinkOptions(estimator=name, terms=("viscous_friction",), select_terms=False)
                    found = identify_links(body, seen.recordings, options)
                    squares[name].append(float(np.mean(((found.value - truth) / least) ** 2)))
                    if found.withheld is None:
                        low, high = found.interval().T
                        inside[name].append(100.0 * float(np.mean((low < truth) & (truth < high))))
            cells = []
            for name in names:
                ratio, error = _ratio(np.array(squares[name]), np.array(best))
                ratios[name].append(ratio)
                held[name] += inside[name]
                cells.append(f"{ratio:.2f} ± {error:.2f} ({np.mean(inside[name]):.0f})")
            colour = "white" if corner is None else f"to {corner:g} Hz"
            table.add_row(case, f"{rate:g}", colour, f"{np.mean(known):.0f}", *cells)
    console = Console(width=180)
    console.print(table)
    for name in names:
        within = sum(ratio <= WITHIN for ratio in ratios[name])
        console.print(
            f"{name}: within {WITHIN} × the bound in {within} of {len(ratios[name])} cases; "
            f"intervals hold {np.mean(held[name]):.1f} % of the truths, "
            f"and are withheld in {len(ratios[name]) * RUNS - len(held[name])} of {len(ratios[name]) * RUNS} runs"
        )
    return [Figure(f"crlb_{name}", max(each), "", "Cramér–Rao bound", 1.0) for name, each in ratios.items()]


def _ratio(squares: NDArray[np.float64], best: NDArray[np.float64]) -> tuple[float, float]:
    """Root of the ratio of sums over runs, and its standard error by leaving out one run at a time."""
    without = np.sqrt((squares.sum() - squares) / (best.sum() - best))
    runs = len(squares)
    return float(np.sqrt(squares.sum() / best.sum())), float(
        np.sqrt((runs - 1) * np.mean((without - without.mean()) ** 2))
    )
