"""Processor time of a diagnosis: 60 s of six-joint motion, all hypotheses, with cross-validation, on one core.

Reading the files is not counted. The figure is for a hundred hypotheses, as the goal is; beside it stands how many
there were.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time

import numpy as np

from benchmarks.figure import Figure

RATE_HZ = 250.0
PLAYINGS = 2
NOISE = np.array([0.9, 1.2, 0.7, 0.3, 0.15, 0.1])
"""N·m, white."""
GOAL_SECONDS = 2.0


def child() -> None:
    """In a process of its own, with threads at one; prints seconds and hypotheses."""
    from config import load_installation
    from config.motion import load_motion, sample
    from estimator import Trajectory, inverse_dynamics, load_rigid_body
    from estimator.diagnosis.diagnose import diagnose
    from estimator.effects import catalogue

    installation = load_installation("puma600")
    body = load_rigid_body((installation.path.parent / installation.arm.urdf).read_text(), installation.joint_names)
    random = np.random.default_rng(1)
    true = body.prior() * (1.0 + 0.02 * np.repeat(random.normal(size=body.n), 10))
    recordings, seconds = [], 0.0
    for number in (1, 2):
        motion = sample(load_motion(f"puma600-identify-{number}", installation), RATE_HZ)
        kept = min(len(motion.t), int(60.0 / (2 * PLAYINGS) * RATE_HZ))
        q, dq, ddq = motion.q[:kept], motion.dq[:kept], motion.ddq[:kept]
        tau = inverse_dynamics(body, true, q, dq, ddq)
        tau[:, 1] += 2.0 * np.tanh(dq[:, 1] / 0.005)
        tau[:, 3] += 0.3 * dq[:, 3]
        for playing in range(PLAYINGS):
            noisy = tau + NOISE * random.normal(size=q.shape)
            measured = q + 1e-6 * random.normal(size=q.shape)
            recordings.append(Trajectory(motion.t[:kept], measured, noisy, name=f"motion {number}, playing {playing}"))
            seconds += kept / RATE_HZ
    begun = time.process_time()
    found = diagnose(body, recordings)
    spent = time.process_time() - begun
    hypotheses = sum(len(effect.places(body)) for effect in catalogue().values())
    named = [(f.effect, f.place.joint) for f in found.findings]
    print(json.dumps({"spent": spent, "hypotheses": hypotheses, "seconds": seconds, "named": named}))


def measure() -> list[Figure]:
    one_core = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
    command = [sys.executable, "-c", "from benchmarks.bench_diagnose import child; child()"]
    told = json.loads(subprocess.run(command, env=one_core, capture_output=True, text=True, check=True).stdout)
    said = f"{told['hypotheses']} hypotheses, {told['seconds']:.0f} s of motion; goal 2 s a hundred"
    a_hundred = 100.0 * told["spent"] / told["hypotheses"]
    return [Figure("diagnose_time", a_hundred, "s of CPU a hundred hypotheses", said, GOAL_SECONDS)]
