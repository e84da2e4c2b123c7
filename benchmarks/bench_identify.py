"""Throughput and memory of link identification, end to end (regressor, reduction, estimate, errors), on one core.

Six joints, a million samples. The reference for speed is a bare loop of `pin.computeJointTorqueRegressor` on the same
core; both by processor time, which other work on the machine does not enter. For memory, 60 MB above the input.

FIGAROH's figures are as reported where it was tried on another machine: it is not run here, and its ratio says no more
than the order of magnitude.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time

import numpy as np

from benchmarks.figure import Figure

SAMPLES = 1_000_000
RATE_HZ = 500.0
TRAJECTORIES = 10
FIGAROH_SAMPLES_PER_S = 8_000.0
FIGAROH_BYTES_A_SAMPLE = 2.8e9 / 100_000


def child() -> None:
    """In a process of its own, so that its peak memory is of this work alone; prints seconds, MB and samples."""
    import resource

    import pinocchio as pin

    from config import load_installation
    from config.motion import load_motion, sample
    from estimator import LinkOptions, Trajectory, identify_links, inverse_dynamics, load_rigid_body

    installation = load_installation("puma600")
    urdf = installation.path.parent / installation.arm.urdf
    body = load_rigid_body(urdf.read_text(), installation.joint_names)
    motion = sample(load_motion("puma600-identify-1", installation), RATE_HZ)
    rng = np.random.default_rng(1)
    repeats = -(-SAMPLES // TRAJECTORIES // len(motion.t))
    trajectories = []
    for _ in range(TRAJECTORIES):
        # There and back again, so that the repeated motion is continuous.
        q, dq, ddq = (np.concatenate([x, s * x[::-1]]) for x, s in ((motion.q, 1), (motion.dq, -1), (motion.ddq, 1)))
        q, dq, ddq = (np.tile(x, (repeats // 2 + 1, 1))[: SAMPLES // TRAJECTORIES] for x in (q, dq, ddq))
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + rng.normal(0, 0.1, q.shape)
        t = np.arange(len(q)) / RATE_HZ
        trajectories.append(Trajectory(t=t, q=q + rng.normal(0, 1e-5, q.shape), dq=dq, tau=tau))
    del q, dq, ddq, tau
    identify_links(body, [trajectories[0]], LinkOptions())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start = time.process_time()
    identify_links(body, trajectories, LinkOptions())
    seconds = time.process_time() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    model = pin.buildModelFromXML(urdf.read_text())
    data, done, began = model.createData(), 0, time.process_time()
    while time.process_time() - began < 5:
        for k in range(1000):
            pin.computeJointTorqueRegressor(
                model, data, trajectories[0].q[k], motion.dq[k % len(motion.dq)], motion.ddq[k % len(motion.ddq)]
            )
        done += 1000
    bare = done / (time.process_time() - began)
    print(json.dumps({"rate": SAMPLES / seconds, "megabytes": (peak - before) / 1024, "bare": bare}))


def measure() -> list[Figure]:
    one_core = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
    command = [sys.executable, "-c", "from benchmarks.bench_identify import child; child()"]
    told = json.loads(subprocess.run(command, env=one_core, capture_output=True, text=True, check=True).stdout)
    return [
        Figure("identify_throughput", told["rate"], "samples/s", "bare loop of pin's regressor", told["bare"]),
        Figure(
            "identify_throughput_figaroh",
            told["rate"],
            "samples/s",
            "FIGAROH as reported, not run here",
            FIGAROH_SAMPLES_PER_S,
        ),
        Figure(
            "identify_memory_figaroh",
            told["megabytes"] / SAMPLES * 1e6,
            "bytes/sample",
            "FIGAROH as reported, not run here",
            FIGAROH_BYTES_A_SAMPLE,
        ),
        Figure("identify_memory", told["megabytes"], "MB", "60 MB above the input", 60.0),
    ]
