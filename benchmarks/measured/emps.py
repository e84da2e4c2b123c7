"""One linear axis: motor, ball screw, carriage (Janot, Gautier, Brunot 2019)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.io import loadmat
from scipy.signal import windows

from benchmarks.measured.dataset import Array, MeasuredArm, data_folder
from estimator import Trajectory

FOLDER = "emps"
_SPAN, _BEFORE = 512, 50
"""Samples about the begin of a pulse, and those before it."""
URDF = """<robot name='emps'>
<link name='rail'/>
<link name='carriage'/>
<joint name='axis' type='prismatic'><parent link='rail'/><child link='carriage'/><axis xyz='1 0 0'/>
<limit lower='-0.05' upper='0.3' velocity='0.5' effort='400'/></joint>
</robot>
"""


def emps() -> MeasuredArm:
    """Angles stand for metres and torques for newtons: force = gtau · motor voltage, both as measured; the velocity is
    not measured. The pulses are forces added to the controller's; the voltage holds them."""
    return MeasuredArm(
        "emps",
        URDF,
        {"emps": _recording("DATA_EMPS.mat"), "emps_pulses": _recording("DATA_EMPS_PULSES.mat")},
        held_out=("emps_pulses",),
    )


class Response(NamedTuple):
    """What acceleration the force pulses bring: ``mass`` times acceleration over force, beside that of a rigid mass."""

    frequency: Array
    """Hz"""
    ratio: Array
    """1 of a rigid mass; more towards the resonance of one on a spring, less towards a zero"""
    coherence: Array
    """share of the acceleration that goes with the pulses"""


def response_to_pulses(mass: float) -> Response:
    """Averaged over all pulses: the force is that of the voltage, the pulses tell which of it is no answer to the
    motion (an instrument). ``mass`` kg."""
    data = loadmat(data_folder(FOLDER) / "DATA_EMPS_PULSES.mat")
    pulses = data["pulses_N"].ravel().astype(float)
    force = float(data["gtau"].squeeze()) * data["vir"].ravel()
    period = float(np.median(np.diff(data["t"].ravel())))
    position = data["qm"].ravel()
    acceleration = np.zeros_like(position)
    acceleration[1:-1] = np.diff(position, 2) / period**2
    starts = np.flatnonzero(np.diff(pulses) > 0.0) - _BEFORE
    taper = windows.tukey(_SPAN, 0.3)

    def spectra(channel: Array) -> Array:
        parts = np.stack([channel[k : k + _SPAN] for k in starts if 0 <= k <= len(channel) - _SPAN])
        return np.asarray(np.fft.rfft((parts - parts.mean(axis=1, keepdims=True)) * taper))

    pulsed, answered, pushed = spectra(pulses), spectra(acceleration), spectra(force)
    cross = (answered * pulsed.conj()).sum(axis=0)
    powers = (np.abs(pulsed) ** 2).sum(axis=0) * (np.abs(answered) ** 2).sum(axis=0)
    frequency: Array = np.asarray(np.fft.rfftfreq(_SPAN, period), dtype=np.float64)
    # What second differences make of a sine.
    differenced = np.sinc(frequency * period) ** 2
    ratio = mass * np.abs(cross / (pushed * pulsed.conj()).sum(axis=0)) / differenced
    return Response(frequency, ratio, np.abs(cross) ** 2 / powers)


def _recording(file: str) -> Trajectory:
    data = loadmat(data_folder(FOLDER) / file)
    force = float(data["gtau"].squeeze()) * data["vir"]
    return Trajectory(data["t"].ravel(), data["qm"], force, q_desired=data["qg"], name=file)
