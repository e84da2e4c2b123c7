"""Section 6.5: learning with a simplified model fails or works, and the certificate says so before anything moves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from learner.certificate import certify
from learner.cosine_spectrum import frequencies, low_pass, to_history, to_lines
from learner.inverse_model import DecoupledModel, InverseModel, mean_inertia
from learner.kinematics import Kinematics
from learner.operators import ModelOperator
from learner.trial import Reference

Array = NDArray[np.float64]
PERIOD = 2e-3
START = (0.0, 90.0)
FAST_1, FAST_2, SLOW = ((90.0, 17.0), 1.0), ((90.0, 45.0), 1.0), ((90.0, 45.0), 2.0)
INERTIA = np.array([5 / 3, 1 / 3])


def learnt(
    arm: Any, model: InverseModel, reference: Reference, trials: int, band_hz: float | None = None
) -> list[float]:
    """Greatest angle error of each trial, rad, starting from the operator's own model (Eq. 6.14)."""
    kinematics = Kinematics(PERIOD, held=True, flat_hz=None)
    operator = ModelOperator(model, kinematics)
    base = model.torque(*kinematics.at_torques(reference.q, reference.dq))
    torque, peaks = base, []
    gain = np.ones(reference.samples) if band_hz is None else low_pass(frequencies(reference.samples, PERIOD), band_hz)
    for _ in range(trials):
        trial = arm.play(reference, arm.timing.command(torque))
        peaks.append(float(np.abs(trial.q - reference.q).max()))
        correction = trial.tau - operator.command_error(trial, reference) - base
        torque = base + to_history(gain[:, None] * to_lines(correction))
    return peaks


def test_the_decoupled_operator_first_helps_then_spoils(planar_arm: Any, motion: Callable[..., Reference]) -> None:
    reference = motion(START, *FAST_1, PERIOD)
    peaks = learnt(planar_arm(PERIOD), DecoupledModel(INERTIA), reference, 8)
    assert peaks == pytest.approx([0.37, 0.18, 0.11, 0.14, 0.20, 0.33, 0.57, 1.5], rel=0.06)


@pytest.mark.parametrize("move", [FAST_1, FAST_2, SLOW])
def test_the_full_model_needs_one_trial(
    move: Any, planar_arm: Any, planar_model: InverseModel, motion: Callable[..., Reference]
) -> None:
    reference = motion(START, *move, PERIOD)
    peaks = learnt(planar_arm(PERIOD), planar_model, reference, 2)
    assert peaks[1] < 1e-5


@pytest.mark.parametrize(("move", "verdict"), [(FAST_1, "refused"), (FAST_2, "refused"), (SLOW, "converges")])
def test_the_certificate_tells_the_cases_apart(
    move: Any, verdict: str, planar_arm: Any, planar_model: InverseModel, motion: Callable[..., Reference]
) -> None:
    reference, arm = motion(START, *move, PERIOD), planar_arm(PERIOD)
    operator = ModelOperator(DecoupledModel(INERTIA), Kinematics(PERIOD, held=True, flat_hz=None), "decoupled")
    found = certify(planar_model, reference, arm.loop, operator)
    assert found.verdict == verdict
    peaks = learnt(arm, DecoupledModel(INERTIA), reference, 8, found.band_hz or None)
    if found.admitted:
        assert peaks[-1] < 0.01 * peaks[0]
    else:
        assert peaks[-1] > 2.0 * min(peaks)
    full = certify(planar_model, reference, arm.loop, ModelOperator(planar_model, operator.kinematics))
    assert full.verdict == "converges"
    assert full.gain.max() < 0.1


def test_mean_inertia_of_the_example(planar_model: InverseModel) -> None:
    poses = np.column_stack([np.zeros(361), np.linspace(0, 2 * np.pi, 361)])
    np.testing.assert_allclose(mean_inertia(planar_model, poses), INERTIA, rtol=1e-12)
