"""Torque errors on recordings that others measured, beside what is published about them.

``100·‖residual‖/‖measured‖`` over all joints, percent. *Band-limited*: in the band of the estimate, where joints whose
rests contradict their motion count while they move. *Raw*: against the torque as it was measured, at the full rate,
rests included. Data sets that are not in ../shared/data are left out.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.figure import Figure
from benchmarks.measured import MeasuredArm, emps, is_here, kinova, kuka, panda, whole_panda
from estimator import LinkIdentification, LinkOptions, Trajectory, identify_links
from estimator.links import Prior
from estimator.prediction import torque_history

PUBLISHED_PANDA, PUBLISHED_EMPS, PUBLISHED_PULSES = 1.41, 4.0834, 5.9824


def measure() -> list[Figure]:
    figures: list[Figure] = []
    for folder, of_set in (("franka_panda", _panda), ("emps", _emps), ("kuka_kr300", _kuka), ("kinova_gen3", _kinova)):
        if is_here(folder):
            figures += of_set()
        else:
            print(f"{folder} is not in ../shared/data: left out", file=sys.stderr)
    return figures


def _panda() -> list[Figure]:
    arm, whole = panda(), whole_panda()
    found, halves = identify_links(arm.body, [whole]), _judged(arm)
    reference = "published least squares, same samples"
    return [
        Figure(_in("panda_fit", found), found.fit.relative_error, "%", reference, PUBLISHED_PANDA),
        Figure("measured_panda_fit_raw", _raw(found, [whole]), "%", reference, PUBLISHED_PANDA),
        Figure(_in("panda_second_half_held_out", halves), _held_out(halves), "%", reference, PUBLISHED_PANDA),
    ]


def _emps() -> list[Figure]:
    arm = emps()
    found = _judged(arm, LinkOptions(band_hz=40.0))
    reference = "published symmetric model, 40 Hz"
    return [
        Figure(_in("emps_fit", found), found.fit.relative_error, "%", reference, PUBLISHED_EMPS),
        Figure(_in("emps_pulses_held_out", found), _held_out(found), "%", reference, PUBLISHED_PULSES),
        Figure("measured_emps_fit_raw", _raw(found, arm.training), "%", "none published", None),
    ]


def _kuka() -> list[Figure]:
    arm = kuka()
    found = _judged(arm)
    return [
        Figure(_in("kuka_fit", found), found.fit.relative_error, "%", "none published", None),
        Figure(_in("kuka_held_out", found), _held_out(found), "%", "none published", None),
        Figure("measured_kuka_held_out_raw", _raw(found, arm.judging), "%", "none published", None),
    ]


def _kinova() -> list[Figure]:
    arm = kinova()
    short, other, _ = arm.recordings.values()
    prior = Prior(arm.body.prior(), 1.0)
    found = identify_links(arm.body, [short], LinkOptions(band_hz=5.0), [other], prior)
    return [
        Figure(_in("kinova_fit_prior", found), found.fit.relative_error, "%", "none published", None),
        Figure(_in("kinova_held_out_prior", found), _held_out(found), "%", "none published", None),
        Figure("measured_kinova_held_out_raw", _raw(found, [other]), "%", "none published", None),
    ]


def _judged(arm: MeasuredArm, options: LinkOptions | None = None) -> LinkIdentification:
    return identify_links(arm.body, arm.training, options, arm.judging)


def _held_out(found: LinkIdentification) -> float:
    assert found.hold_out is not None
    return found.hold_out.relative_error


def _in(name: str, found: LinkIdentification) -> str:
    return f"measured_{name}_{found.band:.0f}_hz"


def _raw(found: LinkIdentification, trajectories: list[Trajectory]) -> float:
    histories = [torque_history(found, trajectory) for trajectory in trajectories]
    left = sum(float(np.sum((h.measured - h.predicted) ** 2)) for h in histories)
    return 100.0 * float(np.sqrt(left / sum(float(np.sum(h.measured**2)) for h in histories)))
