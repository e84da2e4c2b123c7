"""Loads from joint torques: the same motion free and loaded, other motions, joints that rub as no model does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.loads.from_torques import load_from_torques
from estimator.loads.parameters import rigid_load
from estimator.loads.same_motion import free_twin
from tests.estimator.loaded_arm import at_tool

Array = NDArray[np.float64]
TRUTH = rigid_load(2.2, np.array([0.01, -0.02, 0.06]), np.array([0.012, 1e-3, 0.0, 0.004, 0.0, 0.013]))


def measured(
    body: RigidBody,
    motion: tuple[Array, Array, Array, Array],
    seed: int,
    *,
    load: bool,
    rub: float = 0.0,
    lag: float = 0.0,
) -> Trajectory:
    """Torques of the arm by its URDF, with a load in the tool's frame moved to the last link by its pseudo-inertia;
    ``rub``: Coulomb friction that varies with the angle, N·m."""
    t, q, dq, ddq = motion
    psi = body.prior() + at_tool(body, TRUTH) if load else body.prior()
    random = np.random.default_rng(seed)
    tau = inverse_dynamics(body, psi, q, dq, ddq) + 0.2 * random.normal(size=q.shape)
    tau += rub * (1.0 + 0.4 * np.sin(7.0 * q)) * np.tanh(dq / 0.01)
    return Trajectory(
        t + lag, q + 1e-5 * random.normal(size=q.shape), tau, dq, name=f"{'loaded' if load else 'free'} {seed}"
    )


def assert_close(load: Any, factor: float = 4.0) -> None:
    for found, truth in ((load.mass, TRUTH.mass), (load.centre, TRUTH.centre)):
        assert np.all(np.abs(found.value - truth.value) < factor * found.standard_error)


@pytest.mark.parametrize("rub", [0.0, 2.0])
def test_the_same_motion_free_takes_friction_away(dda: RigidBody, make_periodic: Any, rub: float) -> None:
    motion = make_periodic(3, 6.0, 500.0, 1)
    loaded = measured(dda, motion, 1, load=True, rub=rub, lag=0.4)
    free = [
        measured(dda, make_periodic(3, 6.0, 500.0, 9), 2, load=False, rub=rub),
        measured(dda, motion, 3, load=False, rub=rub),
    ]
    twin = free_twin(loaded, free)
    assert twin is not None
    assert (twin.name, twin.lag) == ("free 3", pytest.approx(-0.4, abs=1e-3))
    found = load_from_torques(dda, "tool", [loaded], free)
    assert found.paired == ("free 3",)
    assert_close(found.load)
    assert found.load.mass.standard_error < 0.1


def test_other_motions_are_bridged_by_the_free_model_and_its_errors_counted(dda: RigidBody, make_periodic: Any) -> None:
    free = [measured(dda, make_periodic(3, 6.0, 500.0, seed), seed, load=False, rub=2.0) for seed in (11, 12, 13)]
    loaded = [measured(dda, make_periodic(3, 6.0, 500.0, 21), 21, load=True, rub=2.0)]
    found = load_from_torques(dda, "tool", loaded, free)
    assert found.paired == (None,)
    assert found.widening >= 1.0
    assert_close(found.load)
    single = load_from_torques(dda, "tool", loaded, free[:1])
    assert "second free recording" in single.warnings[0]


def test_recordings_of_other_joints_are_refused(dda: RigidBody, make_periodic: Any) -> None:
    motion = make_periodic(3, 4.0, 500.0, 1)
    good = measured(dda, motion, 1, load=False)
    wrong = Trajectory(good.t, good.q[:, :2], good.tau[:, :2], name="two joints")
    with pytest.raises(InputError, match="two joints: has 2 joints"):
        load_from_torques(dda, "tool", [wrong], [good])
    short = Trajectory(
        good.t[:40], good.q[:40], good.tau[:40], good.dq[:40] if good.dq is not None else None, name="short"
    )
    with pytest.raises(InputError, match="longer motion"):
        load_from_torques(dda, "tool", [short], [good])
