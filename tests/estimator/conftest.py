"""Arms and motions of known truth for the estimator's tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics, load_rigid_body
from estimator.loads import LoadRecording

Array = NDArray[np.float64]
ROOT = Path(__file__).parents[2]

THESIS_MOTIONS = (
    ((330.0, 289.1, 230.0), (80.0, 39.1, -10.0)),
    ((330.0, 269.1, -30.0), (80.0, 19.1, 220.0)),
    ((80.0, 269.1, -30.0), (330.0, 19.1, 220.0)),
)


@pytest.fixture(scope="session")
def dda() -> RigidBody:
    """The MIT direct drive arm with the thesis' CAD values."""
    return load_rigid_body(ROOT / "config/arms/dda/dda.urdf")


def chain_urdf(kinds: str, aligned: bool, seed: int = 3) -> str:
    """A serial chain: r revolute, c continuous, p prismatic; axes along z of right-angled frames, or anywhere."""
    random = np.random.default_rng(seed)
    kind_of = {"r": "revolute", "c": "continuous", "p": "prismatic"}
    text = "<robot name='chain'><link name='l0'/>"
    for k, kind in enumerate(kinds, 1):
        turn = (np.pi / 2 if k % 2 == 0 else 0.0, 0.0, 0.0) if aligned else random.normal(size=3)
        axis = (0.0, 0.0, 1.0) if aligned else random.normal(size=3)
        text += (
            f"<link name='l{k}'><inertial><origin xyz='.1 .05 .2'/><mass value='{7 - k}'/>"
            "<inertia ixx='.2' ixy='.01' ixz='.02' iyy='.25' iyz='0' izz='.15'/></inertial></link>"
            f"<joint name='j{k}' type='{kind_of[kind]}'><parent link='l{k - 1}'/><child link='l{k}'/>"
            f"<origin xyz='{0.1 * k} 0 .3' rpy='{turn[0]} {turn[1]} {turn[2]}'/>"
            f"<axis xyz='{axis[0]} {axis[1]} {axis[2]}'/>"
            "<limit lower='-3' upper='3' velocity='3' effort='100'/></joint>"
        )
    return text + "</robot>"


@pytest.fixture(scope="session")
def make_chain() -> Callable[..., RigidBody]:
    def make(kinds: str, aligned: bool = True) -> RigidBody:
        return load_rigid_body(chain_urdf(kinds, aligned))

    return make


@pytest.fixture(scope="session")
def six_axis(make_chain: Callable[..., RigidBody]) -> RigidBody:
    return make_chain("rrrrrr")


@pytest.fixture(scope="session")
def thesis_motions() -> list[tuple[Array, Array, Array, Array]]:
    """The three identification motions (t, q, dq, ddq), 1 kHz, with 0.3 s of rest around them."""
    result = []
    for start, end in THESIS_MOTIONS:
        t = np.arange(-300, 1601) / 1000.0
        s = np.clip(t / 1.3, 0.0, 1.0)
        way = np.radians(end) - np.radians(start)
        q = np.radians(start) + way * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]
        dq = way * ((30 * s**2 - 60 * s**3 + 30 * s**4) / 1.3)[:, None]
        ddq = way * ((60 * s - 180 * s**2 + 120 * s**3) / 1.69)[:, None]
        result.append((t + 0.3, q, dq, ddq))
    return result


def periodic(n: int, duration: float, rate: float, seed: int) -> tuple[Array, Array, Array, Array]:
    """A Fourier motion (t, q, dq, ddq) of five harmonics."""
    random = np.random.default_rng(seed)
    t = np.arange(round(duration * rate)) / rate
    q, dq, ddq = np.full((len(t), n), 2.0), np.zeros((len(t), n)), np.zeros((len(t), n))
    for harmonic in range(1, 6):
        w = 2 * np.pi * harmonic / duration
        a, b = random.normal(0.0, 0.5, (2, n))
        s, c = np.sin(w * t)[:, None], np.cos(w * t)[:, None]
        q += a * s + b * c
        dq += w * (a * c - b * s)
        ddq += -(w**2) * (a * s + b * c)
    return t, q, dq, ddq


@pytest.fixture(scope="session")
def make_periodic() -> Callable[..., tuple[Array, Array, Array, Array]]:
    return periodic


@pytest.fixture(scope="session")
def play_twice() -> Callable[..., list[Trajectory]]:
    """Periodic motions of an arm, each played twice, and a law's torque beside the arm's own."""

    def make(
        body: RigidBody,
        law: Callable[[Array, Array], Array] = lambda q, dq: np.zeros_like(q),
        motions: int = 3,
        seconds: float = 5.0,
        noise: float = 0.2,
    ) -> list[Trajectory]:
        random, recordings = np.random.default_rng(0), []
        for motion in range(motions):
            t, q, dq, ddq = periodic(body.n, seconds, 200.0, motion)
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + law(q, dq)
            recordings += [Trajectory(t, q, tau + noise * random.normal(size=q.shape)) for _ in range(2)]
        return recordings

    return make


@pytest.fixture(scope="session")
def measured_dda(dda: RigidBody, thesis_motions: list[tuple[Array, ...]]) -> Callable[..., list[Trajectory]]:
    """Recordings of the thesis' motions on the direct drive arm, with noise and friction as asked for."""

    def make(
        seed: int = 0,
        torque_noise: float = 0.0,
        velocity_noise: float = 0.0,
        viscous: tuple[float, float, float] = (0.0, 0.0, 0.0),
        coulomb: tuple[float, float, float] = (0.0, 0.0, 0.0),
        rotor: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> list[Trajectory]:
        random = np.random.default_rng(seed)
        result = []
        for k, (t, q, dq, ddq) in enumerate(thesis_motions):
            tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq)
            tau += np.array(viscous) * dq + np.array(coulomb) * np.sign(dq) + np.array(rotor) * ddq
            tau += torque_noise * random.normal(size=tau.shape)
            noisy = dq + velocity_noise * random.normal(size=dq.shape)
            result.append(Trajectory(t, q, tau, noisy, q_desired=q, name=f"motion {k + 1}"))
        return result

    return make


@dataclass(frozen=True)
class LoadedArm:
    """The PUMA 600 with a block on its wrist, 200 Hz: 7 s of movement between two rests, and what the wrist feels."""

    body: RigidBody
    t: Array
    q: Array
    wrench: Array
    mass: float
    centre: Array
    inertia: Array
    offset: Array
    noise: Array

    def weigh(self, q: Array, dq: Array, ddq: Array, **other: Any) -> Array:
        """Wrench by Newton and Euler about the centre, by pinocchio's single-sample kinematics of the tool."""
        return newton_euler(
            self.body, q, dq, ddq, **{"mass": self.mass, "centre": self.centre, "inertia": self.inertia} | other
        )

    def recording(
        self,
        seed: int = 0,
        noise: float = 1.0,
        angle_noise: float = 0.0,
        wrench: Array | None = None,
        start: float = 0.0,
    ) -> LoadRecording:
        """With white noise of the sensor, ``noise`` times the usual, and its offset."""
        random = np.random.default_rng(seed)
        felt = self.wrench if wrench is None else wrench
        felt = felt + self.offset + noise * self.noise * random.normal(size=felt.shape)
        q = self.q + angle_noise * random.normal(size=self.q.shape)
        return LoadRecording(Trajectory(self.t, q, np.zeros_like(q), name=f"recording {seed}"), felt, start)


def newton_euler(body: RigidBody, q: Array, dq: Array, ddq: Array, mass: float, centre: Array, inertia: Array) -> Array:
    """f = m(c'' − g), n = I·w' + w×I·w + c×f of a body at the tool."""
    data, frame = body.model.createData(), body.model.getFrameId("tool")
    xx, xy, xz, yy, yz, zz = inertia
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    result = np.empty((len(q), 6))
    for k in range(len(q)):
        pin.forwardKinematics(body.model, data, q[k], dq[k], ddq[k])
        pin.updateFramePlacements(body.model, data)
        w = pin.getFrameVelocity(body.model, data, frame, pin.LOCAL).angular
        a = pin.getFrameClassicalAcceleration(body.model, data, frame, pin.LOCAL)
        g = data.oMf[frame].rotation.T @ body.gravity
        force = mass * (a.linear + np.cross(a.angular, centre) + np.cross(w, np.cross(w, centre)) - g)
        result[k, :3] = force
        result[k, 3:] = tensor @ a.angular + np.cross(w, tensor @ w) + np.cross(centre, force)
    return result


@pytest.fixture(scope="session")
def loaded_puma() -> LoadedArm:
    body = load_rigid_body(ROOT / "config/arms/puma600/puma600.urdf")
    random, t = np.random.default_rng(1), np.arange(1800) / 200.0
    u = np.clip((t - 1.0) / 7.0, 0.0, 1.0)
    q = np.zeros((len(t), 6))
    for harmonic in (3, 5, 8):
        size, phase = random.uniform(0.6, 1.8, 6) / harmonic, random.uniform(0, 6, 6)
        q += size * np.sin(2 * np.pi * harmonic * u[:, None] + phase)
    q *= np.sin(np.pi * u[:, None]) ** 2
    dq = np.gradient(q, t, axis=0)
    block = {
        "mass": 1.106,
        "centre": np.array([0.001, -0.02, 0.047]),
        "inertia": np.array([0.0024, 1e-4, 0.0, 0.0019, 0.0, 0.0006]),
    }
    wrench = newton_euler(body, q, dq, np.gradient(dq, t, axis=0), **block)  # type: ignore[arg-type]
    offset, noise = np.array([1.0, 2.0, -1.0, 0.1, 0.05, -0.2]), np.array([0.3] * 3 + [0.01] * 3)
    return LoadedArm(body, t, q, wrench, offset=offset, noise=noise, **block)  # type: ignore[arg-type]
