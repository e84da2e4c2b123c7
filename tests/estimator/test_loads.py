"""Loads from wrenches: against Newton and Euler about the centre of mass, written out here, and pinocchio's frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory, load_rigid_body
from estimator.loads.frame_motion import frame_motion
from estimator.loads.identification import LoadOptions, identify_load
from estimator.loads.parameters import RigidLoad, rigid_load
from estimator.loads.poses import Poses
from estimator.loads.recognition import recognise, verify
from estimator.loads.recording import LoadRecording
from estimator.loads.recursive import RecursiveLoad
from estimator.loads.static import identify_static_load
from estimator.loads.wrench_regressor import wrench_regressor

Array = NDArray[np.float64]
MASS, CENTRE, INERTIA = 1.106, np.array([0.001, -0.02, 0.047]), np.array([0.0024, 1e-4, 0.0, 0.0019, 0.0, 0.0006])
OFFSET = np.array([1.0, 2.0, -1.0, 0.1, 0.05, -0.2])
NOISE = np.array([0.3] * 3 + [0.01] * 3)
RATE = 200.0


@pytest.fixture(scope="module")
def puma() -> RigidBody:
    return load_rigid_body(Path(__file__).parents[2] / "config/arms/puma600/puma600.urdf")


def true_wrench(body: RigidBody, q: Array, dq: Array, ddq: Array) -> Array:
    """f = m(c'' − g), n = I·w' + w×I·w + c×f, at the tool, by pinocchio's single-sample kinematics."""
    data, frame = body.model.createData(), body.model.getFrameId("tool")
    xx, xy, xz, yy, yz, zz = INERTIA
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    result = np.empty((len(q), 6))
    for k in range(len(q)):
        pin.forwardKinematics(body.model, data, q[k], dq[k], ddq[k])
        pin.updateFramePlacements(body.model, data)
        w = pin.getFrameVelocity(body.model, data, frame, pin.LOCAL).angular
        a = pin.getFrameClassicalAcceleration(body.model, data, frame, pin.LOCAL)
        g = data.oMf[frame].rotation.T @ body.gravity
        force = MASS * (a.linear + np.cross(a.angular, CENTRE) + np.cross(w, np.cross(w, CENTRE)) - g)
        result[k, :3] = force
        result[k, 3:] = inertia @ a.angular + np.cross(w, inertia @ w) + np.cross(CENTRE, force)
    return result


@pytest.fixture(scope="module")
def motion(puma: RigidBody) -> tuple[Array, Array, Array]:
    """t, q and the true wrench: 7 s of movement between two rests."""
    random, t = np.random.default_rng(1), np.arange(1800) / RATE
    u = np.clip((t - 1.0) / 7.0, 0.0, 1.0)
    q = np.zeros((len(t), 6))
    for harmonic in (3, 5, 8):
        q += (
            random.uniform(0.6, 1.8, 6) / harmonic * np.sin(2 * np.pi * harmonic * u[:, None] + random.uniform(0, 6, 6))
        )
    q *= np.sin(np.pi * u[:, None]) ** 2
    dq = np.gradient(q, 1 / RATE, axis=0)
    return t, q, true_wrench(puma, q, dq, np.gradient(dq, 1 / RATE, axis=0))


def recording(t: Array, q: Array, wrench: Array) -> LoadRecording:
    return LoadRecording(Trajectory(t, q, np.zeros_like(q)), wrench)


def test_regressor_is_newton_and_euler(puma: RigidBody) -> None:
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 30, 6))
    load = rigid_load(MASS, CENTRE, INERTIA)
    predicted = wrench_regressor(frame_motion(puma, "tool", q, dq, ddq)) @ load.parameters
    np.testing.assert_allclose(predicted, true_wrench(puma, q, dq, ddq), atol=1e-12)
    np.testing.assert_allclose(load.inertia.value, INERTIA, atol=1e-15)


@pytest.mark.parametrize("form", ["differentiated", "integrated"])
def test_recovery_without_noise(puma: RigidBody, motion: tuple[Array, Array, Array], form: str) -> None:
    t, q, wrench = motion
    found = identify_load(puma, "tool", [recording(t, q, wrench + OFFSET)], options=LoadOptions(form=form))  # type: ignore[arg-type]
    assert found.load.mass.value == pytest.approx(MASS, abs=1e-3)
    np.testing.assert_allclose(found.load.centre.value, CENTRE, atol=2e-4)
    np.testing.assert_allclose(found.load.inertia.value, INERTIA, atol=5e-5)


def test_intervals_cover(puma: RigidBody, motion: tuple[Array, Array, Array]) -> None:
    t, q, wrench = motion
    hits = []
    for seed in range(80):
        random = np.random.default_rng(seed)
        noisy = wrench + OFFSET + NOISE * random.normal(size=wrench.shape)
        found = identify_load(puma, "tool", [recording(t, q + 1e-5 * random.normal(size=q.shape), noisy)])
        for quantity, truth in ((found.load.mass, MASS), (found.load.centre, CENTRE), (found.load.inertia, INERTIA)):
            ends = found.interval(quantity)
            hits.extend(np.atleast_1d((ends[..., 0] <= truth) & (truth <= ends[..., 1])))
    assert 0.93 <= np.mean(hits) <= 0.97


def test_table_3_1_static(puma: RigidBody) -> None:
    random = np.random.default_rng(2)
    q = random.uniform(-2.0, 2.0, (6, 6))
    wrench = true_wrench(puma, q, 0 * q, 0 * q) + OFFSET + NOISE / np.sqrt(1000) * random.normal(size=(6, 6))
    found = identify_static_load(puma, "tool", poses(q, wrench))
    assert abs(found.load.mass.value - MASS) < 0.010
    assert np.abs(found.load.centre.value - CENTRE).max() < 0.001
    assert np.isinf(found.load.inertia.standard_error).all()
    with pytest.raises(InputError, match="gravity"):
        identify_static_load(puma, "tool", poses(np.tile(q[:1], (6, 1)), wrench))


def poses(q: Array, wrench: Array) -> Poses:
    return Poses(q, wrench, np.arange(len(q), dtype=float), np.full_like(wrench, 0.01))


def test_swinging_load_and_missing_channel(puma: RigidBody, motion: tuple[Array, Array, Array]) -> None:
    t, q, wrench = motion
    noisy = wrench + NOISE * np.random.default_rng(3).normal(size=wrench.shape)
    assert identify_load(puma, "tool", [recording(t, q, noisy)]).rigid.verdict == "rigid"
    late = np.roll(noisy, 20, axis=0)
    assert identify_load(puma, "tool", [recording(t, q, late)]).status == "not rigid"
    noisy[:, 2] = np.nan
    found = identify_load(puma, "tool", [recording(t, q, noisy)])
    assert "fz" in found.warnings[0]
    assert abs(found.load.mass.value - MASS) < 0.04


def test_recursive_converges(puma: RigidBody, motion: tuple[Array, Array, Array]) -> None:
    _t, q, wrench = motion
    dq = np.gradient(q, 1 / RATE, axis=0)
    rows = wrench_regressor(frame_motion(puma, "tool", q, dq, np.gradient(dq, 1 / RATE, axis=0)))
    live = RecursiveLoad(RigidLoad(np.zeros(10), np.eye(10)), NOISE, offset_error=np.full(6, 10.0))
    random = np.random.default_rng(4)
    for a, w in zip(rows, wrench + OFFSET, strict=True):
        live.update(a, w + NOISE * random.normal(size=6))
    assert abs(live.load.mass.value - MASS) < 4.0 * live.load.mass.standard_error
    assert live.load.mass.standard_error < 0.005


def test_recognition_and_verification() -> None:
    spread = np.diag([1e-3] + [1e-4] * 3 + [1e-5] * 6) ** 2
    mine = rigid_load(MASS, CENTRE, INERTIA, spread)
    same, other = rigid_load(MASS, CENTRE, INERTIA, name="same"), rigid_load(1.2, CENTRE, INERTIA, name="other")
    assert recognise(mine, [same, other]).name == "same"
    assert recognise(mine, [other]).verdict == "unknown"
    assert verify(mine, same, 0.01, 0.001).verdict == "accepted"
    assert verify(mine, other, 0.01, 0.001).verdict == "rejected"
    assert verify(mine, same, 0.001, 0.001).verdict == "undecided"
