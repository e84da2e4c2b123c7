"""All that can be told of recordings before anything is fitted to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters, base_parameters
from estimator.plausibility.cut_off import cut_off, dead
from estimator.plausibility.doubt import Doubt
from estimator.plausibility.given_model import GivenModel, thinned
from estimator.plausibility.hypotheses import Reading, readings
from estimator.plausibility.misread import UNRELATED, misread
from estimator.plausibility.snapshot import CHANNELS, ORDERS, Fit, Snapshot, fit, inertias, take
from estimator.plausibility.units import (
    speed_against_limits,
    torque_against_masses,
    torques_alike,
    velocity_against_angle,
)
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_WELL = 0.05
"""A misfit that needs no other reading."""
_FAR_BETTER = 0.4
"""Misfit of another reading over that of the channels as they came, to be believed."""
_POOR = 0.2
"""A misfit, on every joint of an arm, that no friction makes."""
_COUPLED = 3
"""Joints of which the way they hang together says whose they are, whatever they weigh; of two, a cogging or a contact
may be more than that."""
_VISIBLE = 0.1
"""What the links should make of it, at least, in half of the joints: where friction and cogging are all there is to
see, nothing is said of the links."""
_BEYOND_NOISE = 4.0
"""Times its white noise: a torque of which a right model leaves no more than a quarter."""
_MOVED = 0.01
"""rad (m): a joint that went so far had a velocity."""
_CLEAR = 5.0
"""Times the residual: an inertia whose sign is beyond doubt."""


def without_unusable_torques(
    body: RigidBody, trajectories: Sequence[Trajectory]
) -> tuple[list[Trajectory], list[Doubt]]:
    """The recordings with torques marked unusable where a channel is cut off or dead, and these channels named.

    A torque that is cut off says only that it was at least that large; fitted as it stands it biases everything.
    """
    result: list[Trajectory] = []
    doubts: list[Doubt] = []
    for trajectory in trajectories:
        silent, flat = dead(trajectory.tau), cut_off(trajectory.tau)
        flat[:, silent] = True
        doubts += [
            _unusable(trajectory, body.joints[joint], joint, bool(silent[joint]), float(np.mean(flat[:, joint])))
            for joint in np.flatnonzero(flat.any(axis=0)).tolist()
        ]
        result.append(replace(trajectory, unusable=flat) if flat.any() else trajectory)
    return result, doubts


def without_dead_velocities(
    body: RigidBody, trajectories: Sequence[Trajectory]
) -> tuple[list[Trajectory], list[Doubt]]:
    """The recordings without the velocities of those in which a joint's never changes although it moves, these named.

    Drivers that measure none publish zeros: no sensor is broken, and the angles tell the velocities.
    """
    result: list[Trajectory] = []
    doubts: list[Doubt] = []
    for trajectory in trajectories:
        silent = np.zeros(body.n, dtype=np.bool_)
        if trajectory.dq is not None:
            moved = np.fmax.reduce(trajectory.q, axis=0) - np.fmin.reduce(trajectory.q, axis=0)
            silent = dead(trajectory.dq) & (moved > _MOVED)
        if silent.any():
            names = tuple(body.joints[joint] for joint in np.flatnonzero(silent))
            problem = f"{trajectory.name}: the velocity of {', '.join(names)} never changes: velocities are left out"
            remedy = "record what is measured, or leave the columns out"
            doubts.append(Doubt("dead velocity channel", names, problem, remedy, float(np.mean(silent)), False))
        result.append(replace(trajectory, dq=None) if silent.any() else trajectory)
    return result, doubts


def examine(body: RigidBody, trajectories: Sequence[Trajectory], believed: bool = False) -> list[Doubt]:
    """What is wrong with the recordings as recordings of this arm; empty when nothing is.

    ``trajectories`` with their unusable torques marked. Units by comparison of channels; order, direction and sign of
    the joints by what fits the arm's structure far better than the channels as they came; size and sign of the torques
    by the URDF's masses where it has some. ``believed``: these masses are no first guess but the model that is to be
    judged, so that what contradicts them all is of another arm, in another unit, or misread; of a body without
    masses it is the way its joints hang together.
    """
    doubts = examine_motion(body, trajectories)
    shot = take(trajectories)
    if doubts or shot is None:
        return doubts or [_too_short(body)]
    base = base_parameters(body)
    found = fit(body, base, shot)
    structure = [] if found is None else _structure(body, base, shot, found)
    doubts = _examine_torques(GivenModel(body, base), trajectories, shot, structure, believed)
    return doubts if doubts or found is not None else [_too_short(body)]


def _examine_torques(
    model: GivenModel, trajectories: Sequence[Trajectory], shot: Snapshot, structure: Sequence[Doubt], believed: bool
) -> list[Doubt]:
    """What is wrong by the arm's structure or else by its masses; see `examine`."""
    body, doubts = model.body, list(structure)
    if believed and np.any(body.prior()[::10] > 0.0):
        doubts = [doubt for doubt in doubts if doubt.wrong]
        if doubts:  # known links tell an angle's sign from its torque's, where bodies of any weight may fit both
            if told := misread(model, thinned(shot)):
                return told
            judged = model.judged(thinned(shot))
            if judged is None or not judged.seen:
                return doubts
            doubts = []
        doubts = [replace(doubt, wrong=True) for doubt in torque_against_masses(body, shot)]
        alike = torques_alike(body, shot)
        doubts = doubts or [doubt for doubt in alike if doubt.wrong]
        return doubts or _against_model(model, trajectories, thinned(shot)) or alike
    if believed and body.n >= _COUPLED:
        doubts = [replace(doubt, wrong=True) for doubt in doubts]
    return doubts or torque_against_masses(body, shot)


def _too_short(body: RigidBody) -> Doubt:
    problem = "the recordings are too short to tell whether joints and torques are in order and of the right sign"
    return Doubt("too short", body.joints, problem, "record three seconds and more", 0.0, False)


def examine_motion(body: RigidBody, trajectories: Sequence[Trajectory]) -> list[Doubt]:
    """What is wrong with angles and velocities alone: their units, by each other and by the URDF's limits."""
    doubts = velocity_against_angle(body, trajectories)
    shot = take(trajectories)
    return doubts if doubts or shot is None else speed_against_limits(body, shot)


def _against_model(model: GivenModel, trajectories: Sequence[Trajectory], shot: Snapshot) -> list[Doubt]:
    """Channels misread; or torques that this arm's links do not explain although they should be seen in them."""
    doubts = misread(model, shot)
    judged = None if doubts else model.judged(shot)
    if judged is None or model.body.n < 2 or judged.share < UNRELATED or judged.seen:
        return doubts
    size = np.sqrt(np.mean(shot.tau**2, axis=0))
    told = (judged.expected > _VISIBLE) & (
        judged.alone * size > _BEYOND_NOISE * _smoothed_noise(trajectories, shot.band)
    )
    if np.count_nonzero(told) < 0.5 * model.body.n:
        return []
    problem = (
        f"the links of this URDF leave {100.0 * judged.share:.0f} % of the torques that friction does not explain: "
        "they are not the links that moved"
    )
    remedy = "check that the URDF is this arm's, and that q and tau are its joints' angles and torques in SI units"
    return [Doubt("another arm", model.body.joints, problem, remedy, judged.share, True)]


def _smoothed_noise(trajectories: Sequence[Trajectory], band: float) -> Array:
    """(n,) N·m that the torques' white noise leaves in a snapshot, by their second differences."""
    noises = []
    for trajectory in trajectories:
        second = np.abs(np.diff(trajectory.tau, 2, axis=0))
        white = np.nanmedian(second, axis=0) / (0.6745 * np.sqrt(6.0))
        noises.append(white * np.sqrt(2.0 * band / trajectory.rate))
    return np.asarray(np.max(noises, axis=0))


def _structure(body: RigidBody, base: BaseParameters, shot: Snapshot, found: Fit) -> list[Doubt]:
    inertia, clear = inertias(body, base, shot, found)
    if np.any(clear > _CLEAR) and np.all(inertia[clear > _CLEAR] < 0.0):
        joints = tuple(body.joints[j] for j in np.flatnonzero(clear > _CLEAR))
        problem = f"accelerating {', '.join(joints)} takes torques of the other sign: their inertias come out negative"
        return [Doubt("torque sign", joints, problem, "turn the torques' sign", -1.0, True)]
    if body.n < 2 or found.misfit < _WELL:
        return []
    best = readings(body, base, shot, found.misfit)[:1]
    if best and best[0].misfit < _FAR_BETTER * found.misfit:
        return [_of_reading(body, best[0], found.misfit)]
    if found.misfit > _POOR:
        problem = f"this arm's links leave {100.0 * found.misfit:.0f} % of the torques of a typical joint unexplained"
        remedy = "check that the URDF is this arm's, and that q, dq and tau are of the same joints and moments"
        return [Doubt("another arm", body.joints, problem, remedy, found.misfit, False)]
    return []


def _of_reading(body: RigidBody, reading: Reading, as_it_is: float) -> Doubt:
    names = [body.joints[j] for j in reading.joints]
    listed = ", ".join(names)
    gain = f"{100.0 * as_it_is:.0f} % of a typical joint's torque stays unexplained, {100.0 * reading.misfit:.1f} % if"
    evidence = reading.misfit / as_it_is
    if reading.kind in ORDERS:
        what = CHANNELS[reading.kind]
        order = ", ".join(f"{body.joints[k]} as {body.joints[j]}" for j, k in enumerate(reading.order) if j != k)
        problem, remedy = f"{what} are out of order: {gain} one reads {order}", f"put the {what} in the URDF's order"
    elif reading.kind == "torque sign":
        problem, remedy = f"the torque of {listed} has the wrong sign: {gain} it is turned", "turn its sign"
    elif reading.kind == "joint turned round":
        problem = f"{listed} is recorded the other way round than in the URDF: {gain} it is turned"
        remedy = "turn the sign of its angle, velocity and torque, or check that the URDF is this arm's"
    else:
        problem, remedy = f"the angles are in degrees: {gain} they are read so", "convert them to rad"
    return Doubt(reading.kind, tuple(names), problem, remedy, evidence, True)


def _unusable(trajectory: Trajectory, name: str, joint: int, silent: bool, share: float) -> Doubt:
    place = f"{trajectory.name}: the torque channel of {name}"
    if silent:
        value = trajectory.tau[0, joint]
        problem = f"{place} says {value:.4g} throughout: its equations are left out"
        return Doubt("dead torque channel", (name,), problem, "check the sensor", share, False)
    problem = f"{place} is cut off at the end of its range in {100.0 * share:.3g} % of the samples: they are left out"
    return Doubt("torque cut off", (name,), problem, "choose a larger range, or a gentler motion", share, False)
