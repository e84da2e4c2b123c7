"""The shipped arms: complete, physical, and as their sources say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from config import Installation, load_installation
from config.bus_time import cycle_budget
from config.loader import HERE, known_arms
from config.motion import check_motion, known_motions, load_motion, sample

ARMS = known_arms()
URDFS = sorted(HERE.glob("arms/*/*.urdf"))


def model_of(path: Path) -> pin.Model:
    return pin.buildModelFromUrdf(str(path))


def urdf_of(installation: Installation) -> Path:
    return installation.path.parent / installation.arm.urdf


def test_the_arms_that_ship() -> None:
    assert ARMS == ("dda", "puma600", "seven")


@pytest.mark.parametrize("arm", ARMS)
def test_joints_follow_the_model(arm: str) -> None:
    """The same joints in the same order as Pinocchio has them, so that arrays need no reordering."""
    installation = load_installation(arm)
    assert list(model_of(urdf_of(installation)).names)[1:] == list(installation.joint_names)


@pytest.mark.parametrize("path", URDFS, ids=lambda p: p.stem)
def test_bodies_are_physical(path: Path) -> None:
    for name, body in zip(list(model_of(path).names)[1:], model_of(path).inertias.tolist()[1:], strict=True):
        moments = np.linalg.eigvalsh(body.inertia)
        assert body.mass > 0 and moments[0] > 0, name
        assert moments[0] + moments[1] >= moments[2] * (1 - 1e-9), f"{name} breaks the triangle inequality"


def test_direct_drive_arm_has_the_cad_parameters(dda: Installation) -> None:
    """Table 4.1: parameters about the link frames; of link 1 only I_zz acts."""
    model = model_of(urdf_of(dda))
    link1, link2, link3 = (body.toDynamicParameters() for body in model.inertias.tolist()[1:])
    # Pinocchio's order: m, mc (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link frame.
    np.testing.assert_allclose(
        link2, [53.01, 0, 3.4081, 16.6505, 7.9088, 0, 7.6766, 0, -1.5036, 0.6807], rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        link3, [19.67, 0.3108, 0, 0.3268, 0.1825, 0, 0.4560, -0.0166, 0, 0.3900], rtol=0, atol=1e-9
    )
    assert link1[9] == pytest.approx(0.7418)
    l2 = model.jointPlacements[3].translation[2]
    assert l2 == pytest.approx(0.45)
    # Table 4.3, column "CAD-Modeled", where it follows from Table 4.1.
    assert link3[3] * l2 + link2[8] == pytest.approx(-1.3565, abs=1e-4)
    assert link2[9] + link3[4] == pytest.approx(0.8632, abs=1e-4)
    assert link1[9] + link2[4] + link3[4] + link3[0] * l2**2 == pytest.approx(12.8169, abs=1e-3)
    assert link2[4] + link3[4] - link2[6] == pytest.approx(0.4147, abs=1e-4)
    assert link3[3] - link2[2] == pytest.approx(-3.0814, abs=1e-3)


def test_direct_drive_arm_has_fifteen_base_parameters(dda: Installation) -> None:
    model = model_of(urdf_of(dda))
    data, random = model.createData(), np.random.default_rng(1)
    rows = [
        pin.computeJointTorqueRegressor(model, data, random.uniform(0, 5, 3), *random.normal(size=(2, 3)))
        for _ in range(60)
    ]
    assert np.linalg.matrix_rank(np.vstack(rows), tol=1e-8) == 15


@pytest.mark.parametrize("arm", ["panda", "seven"])
def test_kinematics_of_the_modified_dh_table(arm: str) -> None:
    """(a, d, alpha) of each joint as published: the frame of joint k is RotX(alpha)·TransX(a)·RotZ(q)·TransZ(d)."""
    half = np.pi / 2
    table = [
        (0, 0.333, 0), (0, 0, -half), (0, 0.316, half), (0.0825, 0, half),
        (-0.0825, 0.384, -half), (0, 0, half), (0.088, 0, half),
    ]  # fmt: skip
    model = model_of(HERE / "arms" / arm / f"{arm}.urdf")
    for placement, (a, d, alpha) in zip(model.jointPlacements.tolist()[1:], table, strict=True):
        turn = pin.utils.rotate("x", alpha)
        np.testing.assert_allclose(placement.rotation, turn, atol=1e-12)
        np.testing.assert_allclose(placement.translation, [a, 0, 0] + turn @ [0, 0, d], atol=1e-12)


@pytest.mark.parametrize(("arm", "least_hz", "most_hz"), [("dda", 4, 10)])
def test_servo_bandwidths(arm: str, least_hz: float, most_hz: float) -> None:
    """Stiffness and damping against the inertia in the middle of the workspace."""
    installation = load_installation(arm)
    model = model_of(urdf_of(installation))
    random = np.random.default_rng(0)
    low, high = np.array([j.limits.position_rad for j in installation.joint]).T
    inertia = np.mean(
        [np.diag(pin.crba(model, model.createData(), random.uniform(low, high))) for _ in range(50)], axis=0
    )
    for gains, damping in (("servo", (0.9, 1.1)), ("digital", (0.6, 0.8))):
        stiffness = np.array([getattr(j, gains).stiffness_nm_rad for j in installation.joint])
        lost = np.array([getattr(j, gains).damping_nms_rad for j in installation.joint])
        pulsation = np.sqrt(stiffness / inertia)
        assert np.all((least_hz * 0.95 < pulsation / (2 * np.pi)) & (pulsation / (2 * np.pi) < most_hz))
        ratio = lost / (2 * np.sqrt(stiffness * inertia))
        assert np.all((damping[0] < ratio) & (ratio < damping[1]))


@pytest.mark.parametrize("arm", ARMS)
def test_motors_hold_the_arm_anywhere(arm: str) -> None:
    """Gravity takes at most what the motors may give for ever, at 1000 ‰, with room for the peaks of Section 4.4."""
    installation = load_installation(arm)
    model = model_of(urdf_of(installation))
    data, random = model.createData(), np.random.default_rng(2)
    low, high = np.array([j.limits.position_rad for j in installation.joint]).T
    gravity = np.max(
        [np.abs(pin.computeGeneralizedGravity(model, data, random.uniform(low, high))) for _ in range(200)], axis=0
    )
    peak = np.array([j.limits.torque_nm for j in installation.joint])
    assert np.all(gravity < 0.7 * peak)


@pytest.mark.parametrize("arm", ARMS)
def test_every_motion_of_an_arm_keeps_its_limits(arm: str) -> None:
    installation = load_installation(arm)
    names = known_motions(installation)
    assert set(installation.arm.identification_motions) <= set(names)
    for name in names:
        check_motion(sample(load_motion(name, installation), installation.cycle.rate_hz), installation, name)


def test_cycles_leave_the_buses_room() -> None:
    shares = {
        arm: max(cycle_budget(installation, bus, mode).load for bus in installation.bus for mode in installation.modes)
        for arm, installation in ((arm, load_installation(arm)) for arm in ARMS)
    }
    assert shares["dda"] < 0.55 and shares["puma600"] < 0.90 and shares["seven"] < 0.65
