"""A session played on the plant itself: the servos close the loop tick by tick, the drives' sensors are recorded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from benchmarks.campaign.motions import RATE_HZ, Playlist
from config import Installation
from virtual_hw.hidden import HiddenMechanics
from virtual_hw.plant import build_plant

Array = NDArray[np.float64]
SETTLE_S = 1.0
"""Time before the first motion, for the loop to take the arm over from its brakes."""
DRIVES_OFF = "drives-off"
"""Name of the run that is no motion: torques at rest with the drives off."""


@dataclass(frozen=True)
class Run:
    """One motion as recorded: ``t`` s since the session's start, ``q``, ``dq``, ``tau`` samples × joints."""

    motion: str
    t: Array
    q: Array
    dq: Array
    tau: Array


def play(installation: Installation, hidden: HiddenMechanics, playlist: Playlist, seed: int) -> list[Run]:
    """Every run of the playlist at the plant's own rate, as the drives measure it. One run follows the other.

    The controller is the installation's servo: τ = k·(q_d − q) + d·(dq_d − dq) on the measured angle and speed.
    """
    plant = build_plant(installation, hidden, seed)
    n = plant.n
    stiffness = [j.servo.stiffness_nm_rad for j in installation.joint]
    damping = [j.servo.damping_nms_rad for j in installation.joint]
    scale = [j.encoder.sign * 2.0 * np.pi / j.encoder.counts_per_turn for j in installation.joint]
    zero = [j.encoder.zero_rad for j in installation.joint]
    free = [False] * n
    axes = range(n)

    def tick(q_d: list[float], dq_d: list[float]) -> tuple[list[float], list[float]]:
        q = [scale[i] * plant.counts(i) + zero[i] for i in axes]
        dq = [plant.velocity(i) for i in axes]
        plant.advance([stiffness[i] * (q_d[i] - q[i]) + damping[i] * (dq_d[i] - dq[i]) for i in axes], free)
        return q, dq

    home, still = list(installation.arm.home_rad), [0.0] * n
    for _ in range(int(SETTLE_S * 1e9 / plant.tick_ns)):
        tick(home, still)
    runs = []
    for name in playlist.order:
        motion = playlist.motions[name]
        begin = plant.time_ns * 1e-9
        q, dq, tau = (np.empty((len(motion.t), n)) for _ in range(3))
        before = [plant.torque(i) for i in axes]
        for k, (q_d, dq_d) in enumerate(zip(motion.q.tolist(), motion.dq.tolist(), strict=True)):
            q[k], dq[k] = tick(q_d, dq_d)
            # Torque is held over a tick and belongs to its middle; between the two it belongs to the angle's instant.
            after = [plant.torque(i) for i in axes]
            tau[k] = [0.5 * (a + b) for a, b in zip(before, after, strict=True)]
            before = after
        runs.append(Run(name, begin + motion.t, q, dq, tau))
    return runs


def read_off(installation: Installation, hidden: HiddenMechanics, seconds: float, seed: int) -> Run:
    """The arm at home with its drives off, held by its brakes, at the plant's own rate, as the drives measure it."""
    plant = build_plant(installation, hidden, seed)
    joints = installation.joint
    scale = [j.encoder.sign * 2.0 * np.pi / j.encoder.counts_per_turn for j in joints]
    count, still, brakes = round(seconds * RATE_HZ), [0.0] * plant.n, [True] * plant.n
    q, dq, tau = (np.empty((count, plant.n)) for _ in range(3))
    for k in range(count):
        plant.advance(still, brakes)
        q[k] = [scale[i] * plant.counts(i) + joints[i].encoder.zero_rad for i in range(plant.n)]
        dq[k] = [plant.velocity(i) for i in range(plant.n)]
        tau[k] = [plant.torque(i) for i in range(plant.n)]
    t = np.arange(count) / RATE_HZ
    return Run(DRIVES_OFF, t, q, dq, tau)


def as_recorded(run: Run, installation: Installation, rng: Generator, every: int, jitter_s: float) -> Run:
    """What a recorder keeps of a run: every so-many-th sample, torque in its drive's ‰, and stamps that jitter."""
    kept = slice(None, None, every)
    grain = np.array([j.rated_torque_nm for j in installation.joint]) / 1000.0
    period = float(run.t[every] - run.t[0])
    late = np.clip(jitter_s * rng.standard_normal(len(run.t[kept])), -0.4 * period, 0.4 * period)
    return Run(run.motion, run.t[kept] + late, run.q[kept], run.dq[kept], np.round(run.tau[kept] / grain) * grain)
