"""A load from one short motion in slow noise: chapter 3's two forms, the optimal filter, and are its errors true?

The two-second motion of chapter 3 on the PUMA with the block of Table 3.1, and on the direct drive arm with the bar of
Table 3.2, measured with their encoders' steps and a wrist sensor 1.5 ms late, whose noise is white and, of about the
same power in the band, Gauss–Markov of 2 Hz; many draws. The noise had no part in the estimator's design.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.signal import lfilter

from benchmarks.bench_loads import CUT_OFF_HZ
from benchmarks.chapter3 import plain_estimate
from benchmarks.figure import Figure
from benchmarks.loaded_arm import BAR, BLOCK, CENTRE, MASS
from config import Installation, load_installation
from config.motion import load_motion, sample
from estimator import Trajectory, load_rigid_body
from estimator.loads import LoadRecording, RigidLoad, align_wrench, identify_load, rigid_load
from estimator.loads.frame_motion import frame_motion
from estimator.loads.wrench_regressor import wrench_of_load
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

RUNS = 60
NOISE_SEED = 2026
ARMS = {"puma600": ("puma", BLOCK), "dda": ("dda", BAR)}
"""Name in the figures, and the load's inertia."""
REST_S = (0.2, 0.5)
"""Before and after the motion."""
LATE_S = 0.0015
NORMAL_95 = 1.96
WHITE, SLOW = np.array([0.12] * 3 + [0.008] * 3), np.array([0.05] * 3 + [0.003] * 3)
"""N, N·m: standard deviations of a sample."""
CORNER_HZ = 2.0
OFFSET = np.array([1.3, -0.8, 2.1, 0.04, -0.06, 0.02])


def measure() -> list[Figure]:
    """Prints rms errors by each way, and coverage of the 95 % intervals; the figures are inertia's errors, coverage."""
    figures = []
    for arm, (name, inertia) in ARMS.items():
        errors, held = _measured(arm, inertia)
        reference = ("differentiated", errors["differentiated"])
        figures += [
            Figure(f"load_noise_inertia_{name}", errors["optimally filtered"], "g·m²", *reference),
            Figure(f"load_noise_coverage_{name}", held, "%", "promised", 95.0),
        ]
    return figures


def _measured(arm: str, inertia: tuple[float, ...]) -> tuple[dict[str, float], float]:
    """rms error of the inertia by each way, g·m², and the share of intervals that hold, %."""
    installation = load_installation(arm)
    body = load_rigid_body((installation.path.parent / installation.arm.urdf).read_text(), installation.joint_names)
    frame = installation.wrench_sensor[0].frame
    true = rigid_load(MASS, np.array(CENTRE), np.array(inertia))
    ways: dict[str, list[RigidLoad]] = {"differentiated": [], "integrated": [], "optimally filtered": []}
    inside, scores, late = [], [], []
    for run in range(RUNS):
        recordings = [_recording(installation, body, frame, true, np.random.default_rng([NOISE_SEED, run]))]
        for form in ("differentiated", "integrated"):
            ways[form].append(plain_estimate(body, frame, recordings, form, CUT_OFF_HZ[arm]))
        found = identify_load(body, frame, recordings)
        ways["optimally filtered"].append(found.load)
        late.append(abs(found.delay.value - LATE_S) < NORMAL_95 * found.delay.standard_error)
        for quantity, right in (
            (found.load.mass, true.mass),
            (found.load.centre, true.centre),
            (found.load.inertia, true.inertia),
        ):
            low, high = np.moveaxis(found.interval(quantity), -1, 0)
            inside.append(np.atleast_1d((low < right.value) & (right.value < high)))
            scores += np.atleast_1d((quantity.value - right.value) / quantity.standard_error).tolist()
    table = Table(title=f"{arm}: rms error, one motion, {RUNS} draws of the noise", title_justify="left", box=None)
    for heading in ("", "mass [g]", "centre [mm]", "inertia [g·m²]"):
        table.add_column(heading, justify="right" if heading else "left")
    of_inertia = {}
    for way, loads in ways.items():
        errors = [
            1e3
            * float(np.sqrt(np.mean([(getattr(load, what).value - getattr(true, what).value) ** 2 for load in loads])))
            for what in ("mass", "centre", "inertia")
        ]
        table.add_row(way, *(f"{error:.2f}" for error in errors))
        of_inertia[way] = errors[-1]
    console = Console(width=120, markup=False)
    console.print(table)
    # The ten quantities of one draw are not ten looks: the draws tell how sure the share is.
    shares = 100.0 * np.reshape(np.concatenate(inside), (RUNS, -1)).mean(axis=1)
    held, sure = float(shares.mean()), float(shares.std(ddof=1) / np.sqrt(RUNS))
    console.print(
        f"intervals hold {held:.1f} ± {sure:.1f} % of the truths, the delay's {100.0 * np.mean(late):.0f} %; "
        f"rms of error over standard error {_rms(scores):.2f}"
    )
    return of_inertia, held


def _recording(
    installation: Installation, body: RigidBody, frame: str, load: RigidLoad, random: np.random.Generator
) -> LoadRecording:
    rate = installation.cycle.rate_hz
    motion = sample(load_motion(f"{installation.arm.name}-load", installation), rate)
    before, after = (round(seconds * rate) for seconds in REST_S)
    q = np.pad(motion.q, ((before, after), (0, 0)), mode="edge")
    dq, ddq = (np.pad(x, ((before, after), (0, 0))) for x in (motion.dq, motion.ddq))
    t = np.arange(len(q)) / rate
    wrench = wrench_of_load(load.parameters, frame_motion(body, frame, q, dq, ddq))
    sensor_rate = installation.wrench_sensor[0].rate_hz
    sampled = np.arange(int(t[-1] * sensor_rate)) / sensor_rate
    seen = np.column_stack([np.interp(sampled - LATE_S, t, channel) for channel in wrench.T])
    fades = float(np.exp(-2.0 * np.pi * CORNER_HZ / sensor_rate))
    drive = random.normal(size=seen.shape)
    # Stationary from the first sample on.
    drive[0] /= np.sqrt(1.0 - fades**2)
    slow = np.sqrt(1.0 - fades**2) * lfilter([1.0], [1.0, -fades], drive, axis=0)
    seen = seen + OFFSET + WHITE * random.normal(size=seen.shape) + SLOW * slow
    step = 2.0 * np.pi / np.array([joint.encoder.counts_per_turn for joint in installation.joint])
    angles = np.round(q / step) * step
    return align_wrench(Trajectory(t=t, q=angles, tau=np.zeros_like(q), name="motion of chapter 3"), sampled, seen)


def _rms(x: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
