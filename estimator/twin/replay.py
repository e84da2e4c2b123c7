"""Replaying a recording in the twin: what would the simulated arm have done under the same controller?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.arm_model import ArmModel
from estimator.trajectory import Trajectory
from estimator.twin.mujoco_plant import CompiledPlant, compile_plant
from estimator.twin.plant import Instant, PlantDraft
from estimator.twin.tracking import Tracking, velocities

Array = NDArray[np.float64]

LONGEST_STEP = 5e-4
"""s of a step of the simulation."""
SHARE_OF_SWING = 0.4
"""A step is at most this share of the time constant of the fastest swing."""
MOST_STEPS = 60
"""In a sample's period."""
RUNAWAY = 1e3
"""rad/s or m/s that no joint reaches."""
CHECK = "look at the model's parameters, and at the gains of the controller"
LEAST_SAMPLES = 3
FIRST_SAMPLES = 8
"""Of a stretch, that the speed it begins with is taken from."""
LONGEST_STRETCH = 1_000_000


@dataclass(frozen=True)
class Simulated:
    """What the twin would have recorded, (samples, n) at the times of the recording; NaN where that has gaps."""

    t: Array
    q: Array
    dq: Array
    tau: Array
    controller: str
    """Under which controller, in words."""

    def position_error(self, trajectory: Trajectory) -> Array:
        """(n,) rms of simulated less recorded angle, rad, of each joint."""
        return np.asarray(np.sqrt(np.nanmean((self.q - trajectory.q) ** 2, axis=0)))


def replay(model: ArmModel, trajectory: Trajectory, controller: Tracking) -> Simulated:
    """Simulate the model from the recording's first sample on, under a controller.

    Gaps end a stretch; the next begins from what was measured there. Raises InputError when there is no stretch, or
    the model cannot be simulated: MuJoCo refuses a body, or it runs away.
    """
    draft = model.plant()
    dq = velocities(trajectory)
    q_out, dq_out, tau_out = (np.full_like(trajectory.q, np.nan) for _ in range(3))
    stretches = [rows for rows in trajectory.segments(LONGEST_STRETCH, 0) if len(rows) >= LEAST_SAMPLES]
    if not stretches:
        raise InputError(trajectory.name, "has no gapless stretch to replay", "record longer motion")
    period = 1.0 / trajectory.rate
    steps = _steps(draft, controller, period)
    plant = compile_plant(draft, period / steps)
    for rows in stretches:
        t = trajectory.t[rows]
        start = _first_speed(t[:FIRST_SAMPLES], trajectory.q[rows[:FIRST_SAMPLES]], dq[rows[:FIRST_SAMPLES]])
        grid = t[0] + np.arange(round((t[-1] - t[0]) / period) + 1) * period
        references = [_at(grid, t, channel[rows]) for channel in (controller.q, controller.dq, controller.tau)]
        run = _Run(draft, plant, steps, controller, trajectory.q[rows[0]], start, float(t[0]))
        recorded = run(*references)
        for out, channel in zip((q_out, dq_out, tau_out), _recorded_late(draft, grid, recorded), strict=True):
            out[rows] = _at(t, grid, channel)
    return Simulated(trajectory.t, q_out, dq_out, tau_out, controller.kind)


class _Run:
    """One stretch: state, laws and references at hand, stepped sample after sample."""

    def __init__(
        self,
        draft: PlantDraft,
        plant: CompiledPlant,
        steps: int,
        controller: Tracking,
        q: Array,
        dq: Array,
        t: float,
    ) -> None:
        self.draft, self.plant, self.steps, self.controller, self.start = draft, plant, steps, controller, t
        self.model, self.data = plant.model, mujoco.MjData(plant.model)
        self.joints = [Instant() for _ in range(draft.body.n)]
        self.h = float(self.model.opt.timestep)
        self.friction = self.model.dof_frictionloss[plant.motor].copy()
        self.rotors = self.model.dof_armature[plant.motor].copy()
        self._begin(self._true(q), dq / draft.velocity_gain)

    def __call__(self, q_ref: Array, dq_ref: Array, tau_ref: Array) -> tuple[Array, Array, Array]:
        """q, dq, tau (samples, n) as the drives would have measured them."""
        k, d = self.controller.stiffness, self.controller.damping
        q, dq, tau = (np.empty_like(q_ref) for _ in range(3))
        between = _Between(self.steps, self.h)
        # What accelerates lent inertia is lent too.
        lent = self.plant.lent * np.gradient(dq_ref, self.steps * self.h, axis=0)
        for sample in range(len(q_ref)):
            pair = slice(sample, sample + 2)
            path = between.curve(q_ref[pair], dq_ref[pair])
            forward = between.line(d * dq_ref[pair] + tau_ref[pair])
            for part in range(self.steps):
                q_now, dq_now = self._measured()
                if not np.abs(dq_now).max() < RUNAWAY:
                    raise InputError("simulation", f"runs away at {self.start + self.data.time:.3g} s", CHECK)
                demand = k * (path[part] - q_now) - d * dq_now + forward[part]
                if part == 0:
                    q[sample], dq[sample], tau[sample] = q_now, dq_now, demand
                self._step(demand, lent[sample])
        return q, dq, tau

    def _begin(self, q: Array, dq: Array) -> None:
        data, plant = self.data, self.plant
        data.qpos[plant.motor], data.qvel[plant.motor] = q, dq
        mujoco.mj_forward(self.model, data)
        for joint, series in self.draft.series.items():
            # The transmission starts where it carries the weight.
            weight = float(data.qfrc_bias[plant.link[joint]])
            give = -weight / series.stiffness if series.stiffness > 0.0 else 0.0
            behind = give - math.copysign(series.gap / 2.0, weight)
            data.qpos[plant.link[joint]] = behind
            if series.link_side:
                data.qpos[plant.motor[joint]] -= behind
        mujoco.mj_forward(self.model, data)

    def _measured(self) -> tuple[Array, Array]:
        """Speeds of MuJoCo's integrator belong half a step before its angles; here they are brought to them."""
        data, motor = self.data, self.plant.motor
        q = data.qpos[motor] - self.draft.angle_offset
        dq = data.qvel[motor] + 0.5 * self.h * data.qacc[motor] * (data.time > 0.0)
        for joint, series in self.draft.series.items():
            if series.link_side:
                behind = self.plant.link[joint]
                q[joint] += data.qpos[behind]
                dq[joint] += data.qvel[behind] + 0.5 * self.h * data.qacc[behind] * (data.time > 0.0)
        for joint, curve in self.draft.angle:
            q[joint] = curve(float(q[joint]))
        return q, dq * self.draft.velocity_gain

    def _true(self, q: Array) -> Array:
        """The true angle of a measured one; sensors' errors are small, so their curves invert by iteration."""
        target, true = q, q.copy()
        for _ in range(5):
            measured = true.copy()
            for joint, curve in self.draft.angle:
                measured[joint] = curve(float(measured[joint]))
            true += target - measured
        return np.asarray(true + self.draft.angle_offset)

    def _step(self, demand: Array, lent: Array) -> None:
        draft, data, motor = self.draft, self.data, self.plant.motor
        true = demand - draft.offset
        for joint, curve in draft.motor:
            true[joint] = curve(float(true[joint]))
        true *= draft.gain
        if draft.rubbing or draft.spending:
            self._laws(true)
        data.qfrc_applied[:] = 0.0
        data.qfrc_applied[motor] = true + lent
        if draft.pushes or draft.walls:
            self._touch(self.start + data.time)
        if data.time == 0.0:
            # The integrator's speeds belong half a step before its angles.
            mujoco.mj_forward(self.model, data)
            data.qvel -= 0.5 * self.h * data.qacc
        mujoco.mj_step(self.model, data)

    def _laws(self, true: Array) -> None:
        """Set the friction of the coming step, and take off ``true`` what the laws spend."""
        draft, data, motor = self.draft, self.data, self.plant.motor
        q, dq = data.qpos[motor], data.qvel[motor]
        spent = data.qfrc_applied + data.qfrc_passive + data.qfrc_constraint
        reached = spent[motor] - self.rotors * data.qacc[motor]
        t = self.start + data.time
        for joint, at in enumerate(self.joints):
            at.q, at.dq, at.t, at.motor = float(q[joint]), float(dq[joint]), t, float(true[joint])
            at.transmitted = float(reached[joint])
        level = self.friction.copy()
        for joint, law in draft.rubbing:
            level[joint] += draft.gain[joint] * law(self.joints[joint])
        self.model.dof_frictionloss[motor] = np.maximum(level, 0.0)
        for joint, law in draft.spending:
            true[joint] -= draft.gain[joint] * law(self.joints[joint])

    def _touch(self, t: float) -> None:
        """What pushes on the last link now."""
        data, last = self.data, self.plant.last_body
        tip = data.xpos[last]
        forces = [push.force for push in self.draft.pushes if push.start <= t < push.end]
        for wall in self.draft.walls:
            depth = float(wall.normal @ tip) - wall.distance
            if depth > 0.0:
                forces.append(-wall.stiffness * depth * wall.normal)
        for force in forces:
            mujoco.mj_applyFT(self.model, data, force, np.zeros(3), tip, last, data.qfrc_applied)


class _Between:
    """References at the steps between two samples; after the last sample they stay."""

    def __init__(self, steps: int, h: float) -> None:
        s = np.arange(steps)[:, None] / steps
        self._linear = np.hstack([1.0 - s, s])
        rise = s**2 * (3.0 - 2.0 * s)
        self._position = np.hstack([1.0 - rise, rise])
        self._slope = np.hstack([s * (1.0 - s) ** 2, s**2 * (s - 1.0)]) * steps * h

    def line(self, values: Array) -> Array:
        """(steps, n) of values (2, n)."""
        return np.asarray(self._linear @ values) if len(values) == 2 else self._still(values)

    def curve(self, positions: Array, speeds: Array) -> Array:
        """(steps, n) of a cubic through positions (2, n) with these speeds: a straight line would leave a path of
        slow samples by T²/8·ddq between them, which a stiff servo turns into torque."""
        if len(positions) < 2:
            return self._still(positions)
        return np.asarray(self._position @ positions + self._slope @ speeds)

    def _still(self, values: Array) -> Array:
        return np.repeat(values, len(self._linear), axis=0)


def _steps(draft: PlantDraft, controller: Tracking, period: float) -> int:
    """Steps a sample: short enough for the swing of a light motor between its transmission and its servo."""
    longest = LONGEST_STEP
    plant = compile_plant(draft, LONGEST_STEP)
    for joint, series in draft.series.items():
        rotor = float(plant.model.dof_armature[plant.motor[joint]])
        swing = math.sqrt((series.stiffness + float(controller.stiffness[joint])) / rotor)
        settling = (series.damping + float(controller.damping[joint])) / rotor
        longest = min(longest, SHARE_OF_SWING / max(swing, settling))
    return min(max(1, math.ceil(period / longest - 1e-9)), MOST_STEPS)


def _first_speed(t: Array, q: Array, dq: Array) -> Array:
    """(n,) rad/s at the first sample: of a parabola through the first angles and speeds."""
    x = t - t[0]
    rows = np.concatenate([np.column_stack([np.ones_like(x), x, x**2]), np.column_stack([0 * x, x**0, 2 * x]) * x[-1]])
    found = np.linalg.lstsq(rows, np.concatenate([q, dq * x[-1]]), rcond=None)[0]
    return np.asarray(found[1])


def _at(new: Array, t: Array, channel: Array) -> Array:
    return np.array([np.interp(new, t, column) for column in channel.T]).T


def _recorded_late(draft: PlantDraft, t: Array, recorded: tuple[Array, Array, Array]) -> list[Array]:
    result = []
    for name, channel in zip(("position", "velocity", "torque"), recorded, strict=True):
        late = draft.late.get(name, np.zeros(channel.shape[1]))
        result.append(np.array([np.interp(t - by, t, own) for by, own in zip(late, channel.T, strict=True)]).T)
    return result
