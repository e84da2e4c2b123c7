"""Dry friction of MuJoCo's own (`frictionloss`) under a servo with an encoder's counts: the joint sticks at every
reversal while its servo gathers torque, which is no presliding."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from config import Installation, load_installation
from estimator import RigidBody, Trajectory, inverse_dynamics, load_rigid_body
from estimator.diagnosis.diagnose import diagnose

Array = NDArray[np.float64]
STEP, EVERY, COUNT = 1e-3, 4, 2e-5
"""s, samples of the plant for one of the recording, rad."""
SERVO_HZ = 8.0


@pytest.fixture(scope="module")
def puma() -> tuple[Installation, RigidBody, str]:
    installation = load_installation("puma600")
    urdf = installation.path.parent / installation.arm.urdf
    return installation, load_rigid_body(urdf.read_text(), installation.joint_names), str(urdf)


def wanted(n: int, seed: int) -> tuple[Array, Array, Array]:
    """Ten seconds of three harmonics a joint, from rest to rest."""
    random, t = np.random.default_rng(seed), np.arange(0.0, 10.0, STEP)
    q, dq, ddq = np.full((len(t), n), 0.3), np.zeros((len(t), n)), np.zeros((len(t), n))
    for harmonic in (2, 3, 5):
        pulse, phase = 2.0 * np.pi * harmonic / 10.0, random.uniform(0.0, 2.0 * np.pi, n)
        size = 0.6 * random.uniform(0.5, 1.0, n) / harmonic
        q += size * np.sin(pulse * t[:, None] + phase)
        dq += size * pulse * np.cos(pulse * t[:, None] + phase)
        ddq -= size * pulse**2 * np.sin(pulse * t[:, None] + phase)
    return q, dq, ddq


def played(
    model: mujoco.MjModel, dofs: list[int], places: list[int], motion: tuple[Array, Array, Array], ahead: Array
) -> tuple[Array, Array]:
    """Angles in counts and torques of the servo, which adds to the torque that is needed ``ahead``."""
    data = mujoco.MjData(model)
    data.qpos[places], data.qvel[dofs] = motion[0][0], motion[1][0]
    mujoco.mj_forward(model, data)
    whole = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, whole)
    pulse, inertia = 2.0 * np.pi * SERVO_HZ, np.diag(whole)[dofs]
    q, tau = np.zeros_like(ahead), np.zeros_like(ahead)
    for k in range(len(ahead)):
        q[k] = np.round(data.qpos[places] / COUNT) * COUNT
        error, slower = motion[0][k] - q[k], motion[1][k] - data.qvel[dofs]
        tau[k] = ahead[k] + inertia * (pulse**2 * error + 1.8 * pulse * slower)
        data.qfrc_applied[dofs] = tau[k]
        mujoco.mj_step(model, data)
    return q, tau


@pytest.mark.timeout(300)
@pytest.mark.parametrize("joint", [2, 4])
def test_a_joint_that_sticks_under_its_servo_has_coulomb_friction(
    puma: tuple[Installation, RigidBody, str], joint: int
) -> None:
    installation, body, urdf = puma
    model = mujoco.MjModel.from_xml_path(urdf)
    model.opt.timestep = STEP
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model.jnt_limited[:], model.geom_contype[:], model.geom_conaffinity[:], model.dof_armature[:] = 0, 0, 0, 0
    joints = [model.joint(name).id for name in installation.joint_names]
    dofs, places = [int(model.jnt_dofadr[j]) for j in joints], [int(model.jnt_qposadr[j]) for j in joints]
    motions = [wanted(body.n, seed) for seed in range(3)]
    ahead = [inverse_dynamics(body, body.prior(), *motion) for motion in motions]
    noise = 0.02 * np.sqrt(np.mean(np.concatenate(ahead) ** 2, axis=0)) + 0.02
    level = 1.2 * float(noise[joint])
    model.dof_frictionloss[dofs[joint]] = level
    random, recordings = np.random.default_rng(1), []
    for number, (motion, needed) in enumerate(zip(motions, ahead, strict=True)):
        for playing in range(2):
            q, tau = played(model, dofs, places, motion, needed)
            noisy = tau + noise * random.normal(size=tau.shape)
            t = STEP * np.arange(0, len(q), EVERY)
            recordings.append(Trajectory(t, q[::EVERY], noisy[::EVERY], name=f"motion {number}, playing {playing}"))
    found = diagnose(body, recordings)
    assert {(f.effect, f.place.joint) for f in found.findings} == {("coulomb_friction", joint)}
    (told,) = found.findings
    assert abs(float(told.parameters["level"].value) - level) < 0.06 * level
    assert not found.unexplained
