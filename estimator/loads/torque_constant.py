"""The torque constant of each joint against the wrist sensor (thesis, section 4.4: force at the end of a known lever).

A load that the wrist weighed needs a torque at each joint that is known through the arm's geometry, which is the
lever. What the joints measure beyond the free arm is that torque over the gain:

    true torque = gain · measured torque      (effect ``torque_constant_error``)

Eq. 4.10 makes torque of phase currents by K_T; its true value is the gain times the one that was used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.loads.fit import fit_load
from estimator.loads.from_torques import KINDS, believed_of_model, difference_rows, free_arm
from estimator.loads.layout import LoadLayout
from estimator.loads.parameters import RigidLoad
from estimator.loads.same_motion import free_twin
from estimator.rigid_body import RigidBody
from estimator.sums import Sums
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_TOLD = 0.2
"""Relative standard error of a gain above which the load hardly reaches the joint."""


@dataclass(frozen=True)
class TorqueGain:
    """Of one joint: true torque over measured torque. NaN and infinite where the load hardly reaches it."""

    joint: str
    gain: float
    standard_error: float
    load_torque_rms: float
    """N·m of the load at the joint while it moves."""


def torque_gains(
    body: RigidBody,
    frame: str,
    load: RigidLoad,
    loaded: Sequence[Trajectory],
    free: Sequence[Trajectory],
    band_hz: float | None = None,
) -> list[TorqueGain]:
    """``load`` as the wrist sensor weighed it, in ``frame``; the same motion ``free`` gives the surest gains.

    Errors are those of the torques and of the load's mass; the sensor's own calibration is what the gain is against.
    Raises InputError for a load that is not known whole, or recordings that do not fit the arm or are too short.
    """
    if not np.isfinite(load.parameters).all():
        raise InputError(load.name, "is not known whole", "weigh it by wrenches in motion first")
    links = free_arm(body, free, band_hz)
    unknown = len(links.value)
    layout = LoadLayout(tuple(range(body.n)), ("inverse gain", *KINDS), body.joints, unknown)
    sums, power = Sums(), np.zeros(body.n)
    for number, trajectory in enumerate(loaded):
        for _, columns, samples in difference_rows(body, frame, links, trajectory, free_twin(trajectory, free)):
            needed = [load.parameters @ c[:10] for c in columns]
            rows = [
                np.vstack([c[10 : 10 + unknown], torque, c[10 + unknown :]])
                for c, torque in zip(columns, needed, strict=True)
            ]
            sums.add(rows, number, np.array([c.any(axis=0).astype(float) for c in columns]))
            sums.samples += samples
            power += [float(torque @ torque) for torque in needed]
    if sums.rows < 20:
        raise InputError("recordings", f"have {sums.rows} rows of gapless loaded motion", "record longer motion")
    fit = fit_load(layout, sums, [believed_of_model(links, layout, 0)])
    place = layout.place("inverse gain")
    inverse, variance = fit.value[place], np.diag(fit.covariance)[place]
    weighed = float(load.mass.standard_error / load.mass.value)
    result = []
    for joint, s, v, p, count in zip(body.joints, inverse, variance, power, np.maximum(sums.counted, 1.0), strict=True):
        gain, error = float("nan"), float("inf")
        if np.isfinite(s) and s > 0.0:
            gain = float(1.0 / s)
            error = float(gain * np.hypot(np.sqrt(v) * gain, weighed))
        if not error < _TOLD * gain:
            gain, error = float("nan"), float("inf")
        result.append(TorqueGain(joint, gain, error, float(np.sqrt(p / count))))
    return result
