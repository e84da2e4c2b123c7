"""Time from a trial to the next feedforward, with a fresh certificate: 7 joints, 1.5 s at 1 kHz. The bound is 1 s."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np

from benchmarks.figure import Figure

BOUND_S = 1.0
REPEATS = 5
ROTOR = 0.4
"""kg·m² at a joint, behind its gear."""


def child() -> None:
    """On one core; prints the median of some updates in s."""
    from config import load_installation
    from config.motion.curves import RestToRest
    from estimator.arm_model import FittedEffect
    from estimator.effects import Place
    from learner.certificate import certify
    from learner.error_gain import Tolerance
    from learner.kinematics import Kinematics
    from learner.operators import ModelOperator
    from learner.practice import Practice, prepare
    from learner.trial import Reference, Trial
    from service.practice.course import FLAT_HZ
    from service.practice.inverse_models import load_inverse_model
    from service.practice.planning import practised_motion

    installation = load_installation("seven")
    practised = practised_motion("seven-identify-1", installation, "csp")
    bodies = load_inverse_model(None, installation)
    # Without its rotors the arm of the URDF is too light for its servo, and no practice would begin.
    rotors = tuple(FittedEffect("rotor_inertia", Place(joint), {"inertia": ROTOR}) for joint in range(7))
    model = replace(bodies, model=replace(bodies.model, effects=rotors))
    home = np.array(installation.arm.home_rad)
    period = 1e-3
    t = np.arange(1501, dtype=np.float64) * period
    motion = RestToRest(np.array([home, home + 0.4]), [1.5], 5).evaluate(t)
    reference = Reference.between_rests(*motion, period, 0, 0)
    kinematics = Kinematics(period, held=True, flat_hz=FLAT_HZ)
    operator = ModelOperator(model, kinematics)
    loop = practised.loop
    rng = np.random.default_rng(1)

    def trial() -> Trial:
        tau = model.torque(reference.q, reference.dq, reference.ddq)
        rubbing = 0.3 * np.tanh(reference.dq / 0.05) + rng.normal(0, 0.1, tau.shape)
        return Trial(
            reference.q + rng.normal(0, 1e-5, tau.shape), reference.dq + rng.normal(0, 1e-3, tau.shape), tau + rubbing
        )

    tolerance = Tolerance(0.1, 1e-3)
    certificate = certify(model, reference, loop, operator, tolerance)
    if not certificate.admitted:
        raise RuntimeError(f"nothing to measure: {certificate.reason}")
    task = prepare(model, model, reference, kinematics, operator, certificate, loop, practised.timing, practised.limits)
    practice = Practice(task, [trial() for _ in range(5)])
    seconds = []
    for _ in range(REPEATS):
        new = trial()
        began = time.perf_counter()
        practice.take(new, installation.joint_names)
        certify(model, reference, loop, operator, tolerance)
        seconds.append(time.perf_counter() - began)
    print(json.dumps(float(np.median(seconds))))


def measure() -> list[Figure]:
    one_core = dict(os.environ, OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1")
    command = [sys.executable, "-c", "from benchmarks.bench_practice_update import child; child()"]
    told = json.loads(subprocess.run(command, env=one_core, capture_output=True, text=True, check=True).stdout)
    return [Figure("practice_update", told, "s", "the bound", BOUND_S)]
