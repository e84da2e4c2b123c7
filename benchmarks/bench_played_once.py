"""Recordings whose motions were each played once: how often a clean arm raises an alarm, and is what is there named?

Five Fourier motions of the shipped arms, their links off by 2 % and the torques' noise 2 % of them: white, or with two
thirds of its power below 2 Hz, where the motion is too. The laws that are put in are as large as the noise below 15 Hz.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfiltfilt

from benchmarks.figure import Figure
from benchmarks.noisy_motion import PERIOD, fourier
from config.loader import HERE
from estimator import RigidBody, Trajectory, inverse_dynamics, load_rigid_body
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis

Array = NDArray[np.float64]
Law = Callable[[Array, Array], Array]

ARMS = ("dda", "puma600", "seven")
CLEAN, WITH_CAUSE = 21, 9
"""Draws: of clean arms with each noise, and with each law."""
RATE, MOTIONS = 250.0, 5
"""Hz; a motion is one period."""
SCATTER = NOISE = 0.02
LEAST_NOISE = 0.02
"""N·m"""
ANGLE_NOISE = 5e-6
"""rad"""
BAND = 15.0
SLOW_POLE, SLOW_SHARE = 0.95, 0.8
LAWS: dict[str, Law] = {
    "coulomb_friction": lambda q, dq: np.tanh(dq / 0.003),
    "viscous_friction": lambda q, dq: dq,
    "cogging": lambda q, dq: np.sin(7.0 * q + 0.4),
}


def measure() -> list[Figure]:
    """Shares of alarms on clean arms, and of causes that are named on their joint and nothing else with them."""
    bodies = [load_rigid_body(HERE / "arms" / name / f"{name}.urdf") for name in ARMS]
    figures = []
    for noise, slow in (("white", False), ("slow", True)):
        found = [
            diagnose(body, _recordings(body, np.random.default_rng([draw, slow]), slow))
            for draw in range(CLEAN)
            for body in (bodies[draw % len(bodies)],)
        ]
        alarms = 100.0 * float(np.mean([answer.verdict != "clean" for answer in found]))
        figures.append(Figure(f"played_once_alarms_in_{noise}_noise", alarms, "%", "goal, at most", 5.0))
    for name, law in LAWS.items():
        right = []
        for draw in range(WITH_CAUSE):
            body, random = bodies[draw % len(bodies)], np.random.default_rng([draw, 2])
            joint = int(random.integers(body.n))
            right.append(_right(diagnose(body, _recordings(body, random, False, law, joint)), name, joint))
        figures.append(Figure(f"played_once_{name}_named", 100.0 * float(np.mean(right)), "%", "goal", 90.0))
    return figures


def _right(found: Diagnosis, name: str, joint: int) -> bool:
    """Whether the cause is named, or in the set, and no other joint has one."""
    own = [{(f.effect, f.place.joint), *((a.effect, a.place.joint) for a in f.alternatives)} for f in found.findings]
    return any((name, joint) in names for names in own) and all(f.place.joint == joint for f in found.findings)


def _recordings(
    body: RigidBody, random: np.random.Generator, slow: bool, law: Law | None = None, joint: int = 0
) -> list[Trajectory]:
    t = np.arange(round(PERIOD * RATE)) / RATE
    true = body.prior() * (1.0 + SCATTER * np.repeat(random.normal(size=body.n), 10))
    low = butter(4, BAND, fs=RATE, output="sos")
    result = []
    for number in range(MOTIONS):
        q, dq, ddq = fourier(t, int(random.integers(1_000_000)), body.n)
        tau = inverse_dynamics(body, true, q, dq, ddq)
        deviation = NOISE * np.sqrt(np.mean(tau**2, axis=0)) + LEAST_NOISE
        noise = deviation * _noise(random, q.shape, slow)
        if law is not None:
            added = law(q[:, joint], dq[:, joint])
            # As large as the noise of this joint, below the band.
            sizes = (np.std(sosfiltfilt(low, x)) for x in (noise[:, joint], added))
            tau[:, joint] += added * next(sizes) / next(sizes)
        measured = q + ANGLE_NOISE * random.normal(size=q.shape)
        result.append(Trajectory(t, measured, tau + noise, name=f"motion {number}"))
    return result


def _noise(random: np.random.Generator, shape: tuple[int, ...], slow: bool) -> Array:
    """Of variance one."""
    white = random.normal(size=shape)
    if not slow:
        return white
    driven = np.sqrt(1.0 - SLOW_POLE**2) * random.normal(size=shape)
    coloured = lfilter([1.0], [1.0, -SLOW_POLE], driven, axis=0)
    return np.asarray(np.sqrt(1.0 - SLOW_SHARE**2) * white + SLOW_SHARE * coloured)
