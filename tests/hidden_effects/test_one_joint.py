"""Test benches of one joint, a pendulum under its servo. One motion in five is far more vigorous than the others;
nothing beside the joint tells what its link must be."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, load_rigid_body
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis, Finding

Array = NDArray[np.float64]
GRAVITY = 9.81
STEPS = 5000
"""Hz of the integration; the servo holds its torque for five of them."""
SECONDS = 15.0


@dataclass(frozen=True)
class Bench:
    """What it is made of, in N·m, kg·m², s, rad."""

    inertia: float
    """Of the link about the joint, kg·m²."""
    gravity: float
    """N·m that it weighs when it is horizontal."""
    stiffness: tuple[float, float]
    """Of the servo: of the angle and of the speed."""
    reach: float
    count: float
    level: float = 0.0
    viscous: float = 0.0
    by_load: float = 0.0
    cogging: tuple[float, float] = (0.0, 0.0)
    """Amplitude and order."""
    rotor: float = 0.0
    spring: tuple[float, float] | None = None
    """Stiffness and damping between the rotor and the link; rigid without."""
    gap: float = 0.0


def pendulum() -> Bench:
    return Bench(0.0118, 0.86, (30.0, 0.5), 1.0, 2.0 * np.pi / 65536, level=0.1, viscous=0.05)


def of_body(bench: Bench) -> RigidBody:
    """The link alone, as a URDF has it."""
    mass, moment = (bench.gravity / GRAVITY) ** 2 / (0.9 * bench.inertia), 0.1 * bench.inertia
    return load_rigid_body(
        '<robot name="bench"><link name="base"/><link name="arm"><inertial>'
        f'<origin xyz="0 0 {-bench.gravity / GRAVITY / mass}"/><mass value="{mass}"/>'
        f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="joint" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>'
        '<limit lower="-3" upper="3" effort="5000" velocity="50"/></joint></robot>'
    )


def motions(reach: float, random: np.random.Generator) -> dict[str, Array]:
    """(samples,) of each, at the steps of the integration."""
    t = np.arange(0.0, SECONDS, 1.0 / STEPS)
    speeds = np.repeat(np.tile([1.0, -1.0], 5) * np.repeat([0.1, 0.2, 0.4, 0.8, 1.6], 2), STEPS)[: len(t)]
    poses = np.repeat(random.uniform(-1.0, 1.0, 20), int(1.5 * STEPS))[: len(t)]
    told = {
        "two tones": np.sin(2 * np.pi * 0.2 * t) + 0.4 * np.sin(2 * np.pi * 0.8 * t),
        "faster and faster": np.sin(2 * np.pi * (0.1 * t + 0.07 * t**2)),
        "to and fro": np.abs((t / 4.0) % 2.0 - 1.0) - 1.0,
        "from pose to pose": poses - poses[0],
        "constant speeds": np.pad(np.cumsum(speeds) / STEPS, (0, len(t) - len(speeds)), "edge"),
    }
    kernel = np.hanning(int(0.3 * STEPS) | 1)
    kernel /= kernel.sum()
    begun = np.minimum(1.0, t)
    return {
        name: reach * np.convolve(np.pad(begun * x, len(kernel) // 2, "edge"), kernel, "valid")
        for name, x in told.items()
    }


def play(bench: Bench, wanted: Array, random: np.random.Generator, rate: float = 200.0) -> tuple[Array, Array, Array]:
    """Time, measured angle and measured torque (samples,) of the joint under its servo."""
    dt, rigid = 1.0 / STEPS, bench.spring is None
    slope = np.gradient(wanted, dt)
    angle = link = float(wanted[0])
    speed = of_link = acceleration = held = torque = 0.0
    told = np.empty((2, len(wanted)))
    for k, (goal, way) in enumerate(zip(wanted.tolist(), slope.tolist(), strict=True)):
        if k % 5 == 0:
            counted = round(angle / bench.count) * bench.count
            torque = bench.stiffness[0] * (goal - counted) + bench.stiffness[1] * (way - speed)
        if rigid:
            passed = bench.gravity * math.sin(angle) + bench.inertia * acceleration
            load, moved = bench.gravity * math.sin(angle), bench.rotor + bench.inertia
        else:
            stiffness, damping = bench.spring or (0.0, 0.0)
            apart = angle - link
            free = max(abs(apart) - 0.5 * bench.gap, 0.0)
            passed = stiffness * math.copysign(free, apart) + damping * (speed - of_link) * (free > 0.0)
            load, moved = passed, bench.rotor
        level = bench.level + bench.by_load * abs(passed)
        # Stiff bristles: all but Coulomb's law, and the joint sticks.
        held = math.copysign(min(abs(held + 2e6 * level * speed * dt), level), held + 2e6 * level * speed * dt)
        push = bench.cogging[0] * math.sin(bench.cogging[1] * angle + 0.4)
        acceleration = (torque - held - bench.viscous * speed - push - load) / moved
        speed += dt * acceleration
        angle += dt * speed
        if not rigid:
            of_link += dt * (passed - bench.gravity * math.sin(link)) / bench.inertia
            link += dt * of_link
        told[:, k] = angle, torque
    every = int(STEPS / rate)
    q, tau = told[:, ::every]
    noise = 0.005 * np.std(tau) * random.normal(size=len(tau))
    return np.arange(len(q)) / rate, np.round(q / bench.count) * bench.count, tau + noise


def diagnosed(bench: Bench) -> Diagnosis:
    random = np.random.default_rng(5)
    recordings = []
    for name, wanted in motions(bench.reach, random).items():
        for _ in range(2):
            t, q, tau = play(bench, wanted, random)
            recordings.append(Trajectory(t, q[:, None], tau[:, None], name=name))
    return diagnose(of_body(bench), recordings)


def told(diagnosis: Diagnosis) -> dict[str, Finding]:
    return {finding.effect: finding for finding in diagnosis.findings}


def value(finding: Finding, name: str) -> float:
    return float(np.squeeze(finding.parameters[name].value))


def test_a_rotor_that_one_motion_shows_most_of() -> None:
    """Five times the link's inertia; the fastest motion shows hundreds of times what the others do."""
    found = told(diagnosed(replace(pendulum(), rotor=0.06)))
    assert set(found) == {"rotor_inertia", "coulomb_friction", "viscous_friction"}
    assert value(found["rotor_inertia"], "inertia") == pytest.approx(0.06, rel=0.03)


def test_a_strong_cogging_between_the_orders_of_the_grid_is_told_once() -> None:
    diagnosis = diagnosed(replace(pendulum(), inertia=0.02, cogging=(0.15, 24.0)))
    assert sorted(f.effect for f in diagnosis.findings) == ["cogging", "coulomb_friction", "viscous_friction"]
    assert value(told(diagnosis)["cogging"], "order") == pytest.approx(24.0, abs=0.05)
    assert value(told(diagnosis)["cogging"], "amplitude") == pytest.approx(0.15, rel=0.03)


def test_a_gap_of_a_worn_servo() -> None:
    found = told(diagnosed(replace(pendulum(), inertia=0.03, gravity=1.6, rotor=0.01, spring=(3e3, 2.0), gap=0.03)))
    assert found["backlash"].status == "named"
    assert value(found["backlash"], "gap") == pytest.approx(0.03, rel=0.25)


def test_friction_by_load_beside_two_others() -> None:
    found = told(diagnosed(replace(pendulum(), inertia=0.035, gravity=1.9, by_load=0.12)))
    assert set(found) == {"coulomb_friction", "viscous_friction", "load_dependent_friction"}
    assert value(found["load_dependent_friction"], "coefficient") == pytest.approx(0.12, rel=0.03)
