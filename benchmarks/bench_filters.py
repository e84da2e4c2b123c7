"""Differentiate, integrate or filter optimally: figures 5.4 and 5.5 of the thesis again, and what each costs.

A mass of 1 kg is estimated from force and velocity, both with white noise of spectral density 1 (section 5.3). The
equation's error m·jω·V − F is weighted by 1 (velocity differentiated), by 1/ω (force integrated), or by
1/√(m²ω²·S_v + S_f) with m iterated (Eq. 5.49); noise of the velocity is taken out of the normal equation alike in all
three. Printed is each one's error over the Cramér–Rao bound for slow, fast and wide motion; the plot is written to
``docs/pictures/optimal-filters.png``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from benchmarks.figure import Figure

matplotlib.use("Agg")
from matplotlib import pyplot as plt

Array = NDArray[np.float64]

PLOT = Path(__file__).parents[1] / "docs/pictures/optimal-filters.png"
MASS = 1.0
OMEGA = np.linspace(0.01, 40.0, 4000)
"""rad/s of the lines of a record of 628 s."""
RUNS = 400
MOTIONS = {
    "slow, to 0.3 rad/s": (0.01, 0.3),
    "wide, 0.03 to 10 rad/s": (0.03, 10.0),
    "fast, 3 to 10 rad/s": (3.0, 10.0),
}
STRENGTH = 200_000.0
"""Energy of the velocity over the noise's in one line, shared among the motion's lines."""
WEIGHTS: dict[str, Callable[[float], Array]] = {
    "differentiated": lambda mass: np.ones_like(OMEGA),
    "integrated": lambda mass: np.asarray(1.0 / OMEGA),
    "optimal": lambda mass: np.asarray(1.0 / np.sqrt(mass**2 * OMEGA**2 + 1.0)),
}
ITERATIONS = 4


def estimated_mass(velocity: NDArray[np.complex128], force: NDArray[np.complex128], how: str) -> float:
    """Minimum of Σ W²·|m·jω·V − F|² (Eq. 5.33, 5.48), the velocity's noise of density 1 taken out of its matrix."""
    acceleration = 1j * OMEGA * velocity
    mass = 1.0
    for _ in range(ITERATIONS):
        weight = WEIGHTS[how](mass) ** 2
        information = float(np.sum(weight * (np.abs(acceleration) ** 2 - OMEGA**2)))
        mass = float(np.sum(weight * np.real(np.conj(acceleration) * force))) / information
    return mass


def errors_over_bound(band: tuple[float, float], seed: int) -> dict[str, float]:
    """Root mean square error of each way over the Cramér–Rao bound, the true velocity among the unknowns."""
    random = np.random.default_rng(seed)
    inside = (band[0] <= OMEGA) & (band[1] >= OMEGA)
    phase = np.exp(2j * np.pi * random.uniform(size=len(OMEGA)))
    # As much acceleration energy in slow motion as in fast, so that all three can be told.
    velocity = np.where(inside, phase, 0.0) * np.sqrt(STRENGTH / inside.sum() * np.maximum(1.0, 1.0 / OMEGA**2))
    bound = 1.0 / np.sqrt(2.0 * np.sum(OMEGA**2 * np.abs(velocity) ** 2 / (MASS**2 * OMEGA**2 + 1.0)))
    found: dict[str, list[float]] = {how: [] for how in WEIGHTS}
    for _ in range(RUNS):
        noise = random.normal(size=(2, 2, len(OMEGA)))
        of_velocity, of_force = (noise[0] + 1j * noise[1]) / np.sqrt(2.0)
        force = 1j * OMEGA * MASS * velocity + of_force
        for how, values in found.items():
            values.append(estimated_mass(velocity + of_velocity, force, how) - MASS)
    return {how: float(np.sqrt(np.mean(np.square(values)))) / float(bound) for how, values in found.items()}


def draw() -> None:
    """Figure 5.4 (what the optimal filter does to force and velocity) and 5.5 (beside the two simple ways)."""
    omega = np.geomspace(0.01, 100.0, 300)
    ways = {
        "differentiated": np.ones_like(omega),
        "integrated": 1.0 / omega,
        "optimal": 1.0 / np.sqrt(MASS**2 * omega**2 + 1.0),
    }
    figure, panels = plt.subplots(1, 2, figsize=(9.0, 3.6), sharex=True, sharey=True, layout="constrained")
    for how, filtered in ways.items():
        style = {"linewidth": 2.2, "color": "black"} if how == "optimal" else {"linestyle": "--"}
        panels[0].loglog(omega, filtered, label=how, **style)
        panels[1].loglog(omega, omega * filtered, label=how, **style)
    for panel, channel in zip(panels, ("force", "velocity"), strict=True):
        panel.set(title=f"filter of the {channel}", xlabel="ω [rad/s]", ylim=(1e-2, 1e2))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("magnitude")
    panels[0].legend()
    figure.savefig(PLOT, dpi=110)
    plt.close(figure)


def measure() -> list[Figure]:
    draw()
    ratios = {motion: errors_over_bound(band, seed) for seed, (motion, band) in enumerate(MOTIONS.items())}
    table = Table("motion", *WEIGHTS, title=f"rms of error / Cramér–Rao bound, {RUNS} runs")
    for motion, each in ratios.items():
        table.add_row(motion, *(f"{each[how]:.2f}" for how in WEIGHTS))
    Console(width=120).print(table)
    return [
        Figure(f"filter_{how}", max(each[how] for each in ratios.values()), "", "Cramér–Rao bound", 1.0)
        for how in WEIGHTS
    ]
