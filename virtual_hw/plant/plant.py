"""The stand-in arm's mechanics: true bodies in MuJoCo, drive trains and sensors in plain floats, one servo tick a call.

Integration is Störmer–Verlet in its position form, with torques held over the step as a drive holds them:

    q½ = q + h/2·dq          forces at q½ and at the predicted speed dq + h/2·ddq
    dq⁺ = dq + h·ddq          friction solved implicitly, F = explicit + implicit·dq⁺
    q⁺ = q½ + h/2·dq⁺

Angle and speed belong to the same instant and are of second order: an arm without delays shows none.
(MuJoCo's own steppers update the angle by the new speed, which advances it by half a step.)
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Sequence

import mujoco
import numpy as np

from virtual_hw.hidden.bodies import Payload
from virtual_hw.hidden.motor import Motor, phase_currents
from virtual_hw.hidden.noise import noise_rows
from virtual_hw.plant.joint import DriveTrain
from virtual_hw.plant.multibody import Multibody
from virtual_hw.plant.outside import OutsideForces
from virtual_hw.plant.pair import MeshBeat, SharedShaft
from virtual_hw.plant.parts import NOISE_CHANNELS, PlantParts
from virtual_hw.plant.sensing import JointSensors

WrenchSample = tuple[int, list[float]]
"""Instant in ns of the plant's clock; Fx Fy Fz (N), Nx Ny Nz (N·m)."""


class Plant:
    """The arm behind the drives. Starts at rest at the installation's home, brakes on, ``time_ns`` 0."""

    def __init__(self, parts: PlantParts, seed: int) -> None:
        self.n = len(parts.trains)
        """Joints."""
        self.tick_ns = parts.tick_ns
        """The drives' servo tick, ns; one `advance`."""
        self.time_ns = 0
        self._substeps = parts.substeps
        self._h = parts.tick_ns * 1e-9 / parts.substeps
        self._trains: list[DriveTrain] = parts.trains
        self._sensors: list[JointSensors] = parts.sensors
        self._motors: list[Motor] = parts.motors
        self._noise = noise_rows(parts.noise, parts.tick_ns * 1e-9, seed, stream=0)
        self._noise_row = next(self._noise)
        self._shafts: list[SharedShaft] = parts.shafts
        self._beats: list[MeshBeat] = parts.beats
        self._outside: OutsideForces = parts.outside
        self._payload: Payload | None = parts.timed_payload
        self._payload_inertia = (
            parts.multibody.model.body("payload").inertia.copy() if parts.timed_payload is not None else None
        )

        body: Multibody = parts.multibody
        self._model, self._data, self._dof = body.model, body.data, body.dof
        self._wrench_taps: list[tuple[np.ndarray, deque[WrenchSample]]] = []
        self._rotor_armature = parts.armature
        self._q: list[float] = body.data.qpos.tolist()
        self._dq = [0.0] * len(self._q)
        self._ddq = [0.0] * len(self._q)
        self._driven = tuple(zip(self._trains, body.dof, strict=True))
        self._sensed = tuple(
            (sensors, train, dof, on_link, i * NOISE_CHANNELS)
            for i, (sensors, train, dof, on_link) in enumerate(
                zip(parts.sensors, parts.trains, body.dof, parts.encoder_on_link, strict=True)
            )
        )
        # Bytes of MuJoCo's own vectors: packing into them is the cheapest way in.
        self._pack = struct.Struct(f"{len(self._q)}d").pack_into
        self._qpos, self._qvel, self._qfrc, self._armature = (
            memoryview(vector).cast("B")
            for vector in (body.data.qpos, body.data.qvel, body.data.qfrc_applied, body.model.dof_armature)
        )
        self._qacc = body.data.qacc

    @property
    def step_s(self) -> float:
        """Step of the mechanics in s, and of the samples that `tap_wrench` gives."""
        return self._h

    def advance(self, torque_nm: Sequence[float], brake: Sequence[bool]) -> None:
        """One servo tick with these torque demands (N·m at the joint) and brakes (True holds)."""
        for train, demand, braked in zip(self._trains, torque_nm, brake, strict=True):
            train.command(demand, braked)
        if self._payload is not None:
            self._change_payload(self._payload)
        for k in range(self._substeps):
            self._step(self.time_ns * 1e-9 + k * self._h)
        self.time_ns += self.tick_ns
        self._noise_row = noise = next(self._noise)
        for sensors, train, dof, on_link, k in self._sensed:
            angle, speed = (self._q[dof], self._dq[dof]) if on_link else (train.angle, train.speed)
            sensors.sample(angle, speed, train.motor.current_nm, noise[k], noise[k + 1], noise[k + 2])

    def _step(self, t: float) -> None:
        h = self._h
        half = 0.5 * h
        q, dq = self._q, self._dq
        axes = range(len(q))
        q_mid = [q[i] + half * dq[i] for i in axes]
        dq_mid = [dq[i] + half * self._ddq[i] for i in axes]
        applied = [0.0] * len(q)
        armature = self._rotor_armature.copy()
        for train, dof in self._driven:
            speed = dq[dof]
            train.load(q[dof], speed, q_mid[dof], dq_mid[dof], t, h)
            implicit = train.implicit
            applied[dof] = train.force - implicit * speed
            # (M + h·B)·ddq = force − B·dq is force − B·dq⁺ on the true inertia.
            armature[dof] += h * implicit
        for shaft in self._shafts:
            shaft.load(dq, applied, h)
        for beat in self._beats:
            beat.load(q_mid, applied)
        if self._outside:
            self._outside.apply(t)
        pack = self._pack
        pack(self._qpos, 0, *q_mid)
        pack(self._qvel, 0, *dq_mid)
        pack(self._qfrc, 0, *applied)
        pack(self._armature, 0, *armature)
        mujoco.mj_forward(self._model, self._data)
        self._ddq = ddq = self._qacc.tolist()
        self._dq = dq = [dq[i] + h * ddq[i] for i in axes]
        self._q = q = [q_mid[i] + half * dq[i] for i in axes]
        for train, dof in self._driven:
            train.settle(q[dof], dq[dof], h)
        for shaft in self._shafts:
            shaft.settle(dq, h)
        if self._wrench_taps:
            stamp = round((t + half) * 1e9)
            for view, samples in self._wrench_taps:
                samples.append((stamp, view.tolist()))

    def _change_payload(self, payload: Payload) -> None:
        """Hang the payload on and take it off at its times."""
        t = self.time_ns * 1e-9
        there = payload.from_s <= t and (payload.until_s is None or t < payload.until_s)
        body = self._model.body("payload")
        if there != bool(body.mass[0]):
            body.mass[0] = payload.mass_kg if there else 0.0
            body.inertia[:] = self._payload_inertia if there else 0.0

    def counts(self, i: int) -> int:
        """Raw counts of joint i's encoder: angle = sign · counts / counts_per_turn · 2π + zero_rad."""
        return self._sensors[i].counts

    def velocity(self, i: int) -> float:
        """Speed of joint i in rad/s as its drive senses it: tachometer, or differentiated counts."""
        return self._sensors[i].velocity

    def torque(self, i: int) -> float:
        """Torque of joint i in N·m as its drive measures it from the current."""
        return self._sensors[i].torque

    def currents(self, i: int) -> tuple[float, float, float]:
        """Phase currents of joint i in A (Eq. 4.10), with the noise of this tick."""
        law = self._motors[i]
        k = i * NOISE_CHANNELS + 3
        a, b, c = self._noise_row[k : k + 3]
        return phase_currents(law, self._trains[i].motor.current_nm, self._trains[i].angle, (a, b, c))

    def temperature(self, i: int) -> float:
        """Temperature of joint i's motor in °C."""
        return self._trains[i].motor.temperature_c

    def true_state(self) -> tuple[list[float], list[float]]:
        """True link angles (rad) and speeds (rad/s), for those who judge estimates."""
        return [self._q[k] for k in self._dof], [self._dq[k] for k in self._dof]

    def tap_wrench(self, sensor: str) -> deque[WrenchSample]:
        """From now on, every step's true wrench at this sensor's frame, oldest first; the taker removes what it used.

        The wrench is the one that **the sensor exerts on the load** (thesis, section 3.1), in the sensor's frame
        about its origin: a load at rest under a sensor whose z points up reads +m·g in z.
        """
        samples: deque[WrenchSample] = deque()
        address = int(self._model.sensor(f"{sensor}/f").adr[0])
        self._wrench_taps.append((self._data.sensordata[address : address + 6], samples))
        return samples
