"""Designed motions beside the arms' own identification motions and beside random Fourier motions of the same length.

Figures: log determinant of the information about base parameters, friction and offsets; largest standard error of a
base parameter. The designs keep positions, velocities, accelerations and torques within the installations' limits.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.figure import Figure
from config import load_installation
from estimator.excitation import fourier_basis, random_motion
from service.identification.arm_source import of_installation
from service.identification.designed_motion import (
    BASE_HZ,
    HARMONICS,
    PERIODS,
    SAMPLES,
    design_motion,
    information_of,
    limits_of,
)

RANDOM_MOTIONS = 20


def measure() -> list[Figure]:
    figures: list[Figure] = []
    for arm in ("dda", "puma600"):
        installation = load_installation(arm)
        with TemporaryDirectory() as folder:
            designed = design_motion(installation, Path(folder) / "designed.toml")
        body = of_installation(installation).rigid_body(installation.joint_names, {})
        information, limits = information_of(installation, body), limits_of(installation, body)
        basis = fourier_basis(BASE_HZ, HARMONICS, SAMPLES)
        chance = [random_motion(information, basis, limits, PERIODS / BASE_HZ, seed) for seed in range(RANDOM_MOTIONS)]
        best = max(chance, key=lambda motion: motion.log_determinant)
        worst = float(best.standard_errors.max())
        value, error = designed.log_determinant, designed.worst_standard_error
        own, own_error = designed.own_log_determinant, designed.own_worst_standard_error
        random = f"best of {RANDOM_MOTIONS} random Fourier motions"
        figures += [
            Figure(f"excitation_log_determinant_{arm}", value, "nats", "its own motions", own),
            Figure(f"excitation_log_determinant_{arm}_random", value, "nats", random, best.log_determinant),
            Figure(f"excitation_standard_error_{arm}", error, "SI", "its own motions", own_error),
            Figure(f"excitation_standard_error_{arm}_random", error, "SI", random, worst),
        ]
    return figures
