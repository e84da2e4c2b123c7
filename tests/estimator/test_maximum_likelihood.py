"""Maximum likelihood with the motion among the unknowns: right without noise, nearer the bound with it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.noisy_motion import VISCOUS, Bound, Noise, fourier, measured
from config import InputError
from estimator import LinkOptions, RigidBody, Trajectory, identify_links
from estimator.filtering import Decimator, plan_filter
from estimator.motion_spline import motion_spline
from estimator.regressor import inverse_dynamics, inverse_dynamics_slopes

OPTIONS = LinkOptions("maximum_likelihood", terms=("viscous_friction",), select_terms=False)


def test_spline_holds_motion_and_its_derivatives() -> None:
    plan = plan_filter(200.0, 10.0)
    t = np.arange(1000) / plan.rate
    q, dq, ddq = fourier(t, 3)
    spline = motion_spline(len(t), plan)
    found = spline.motion(spline.fitted(q, dq, np.full(3, 1e-10), np.full(3, 1e-8)))
    assert_allclose(found.dq, dq, atol=1e-4)
    for seen, true in zip((found.thinned.q, found.thinned.dq, found.thinned.ddq), (q, dq, ddq), strict=True):
        assert_allclose(seen, true[:: plan.stride], atol=2e-3)


def test_spline_decimates_as_the_rows_do() -> None:
    plan = plan_filter(1000.0, 10.0)
    spline = motion_spline(3000, plan)
    rows = np.random.default_rng(1).normal(size=(2, spline.thin[0].shape[0]))
    assert_allclose((spline.decimate @ rows.T).T, Decimator(plan.decimation)(rows), atol=1e-12)


def test_slopes_of_torque(dda: RigidBody) -> None:
    q, dq, ddq = fourier(np.arange(5) / 5.0, 4)
    slopes = inverse_dynamics_slopes(dda, dda.prior(), q, dq, ddq)
    random = np.random.default_rng(2)
    step = 1e-6 * random.normal(size=(3, 5, 3))
    moved = [inverse_dynamics(dda, dda.prior(), q + s * step[0], dq + s * step[1], ddq + s * step[2]) for s in (1, -1)]
    assert_allclose(np.einsum("osij,osj->si", slopes, step), (moved[0] - moved[1]) / 2.0, atol=1e-10)


def test_exact_without_noise(dda: RigidBody) -> None:
    t = np.arange(1000) / 100.0
    q, dq, ddq = fourier(t, 5)
    tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq) + VISCOUS * dq
    found = identify_links(dda, [Trajectory(t, q, tau, dq)], OPTIONS)
    truth = np.append(found.base.combination @ dda.prior(), VISCOUS)
    assert_allclose(found.value, truth, atol=2e-3)


def test_nearer_the_bound_than_filtering(dda: RigidBody) -> None:
    noise = Noise(np.array([0.5, 0.25, 0.15]), 5e-4, 1e-1)
    bound = Bound(dda, (5, 6), noise)
    squares: dict[str, float] = {"optimal_filter": 0.0, "maximum_likelihood": 0.0, "attained": 0.0}
    for run in range(2):
        seen = measured(dda, (5, 6), 100.0, noise, np.random.default_rng([77, run]))
        squares["attained"] += np.sum((bound.attained(seen.noise) / bound.standard_error) ** 2)
        for name in ("optimal_filter", "maximum_likelihood"):
            options = LinkOptions(name, terms=OPTIONS.terms, select_terms=False)  # type: ignore[arg-type]
            found = identify_links(dda, seen.recordings, options)
            truth = np.append(found.base.combination @ dda.prior(), VISCOUS)
            squares[name] += np.sum(((found.value - truth) / bound.standard_error) ** 2)
    assert squares["maximum_likelihood"] < squares["optimal_filter"]
    assert squares["maximum_likelihood"] < 1.2**2 * squares["attained"]


def test_noise_of_the_motion_must_be_told(dda: RigidBody) -> None:
    t = np.arange(190) / 100.0
    q, dq, ddq = fourier(t, 5)
    tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq)
    with pytest.raises(InputError, match="too short to tell the motion's noise"):
        identify_links(dda, [Trajectory(t, q, tau, dq)], OPTIONS)
