"""What the diagnosis says of each measured arm: the recordings to ask about, and the answer in short."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.measured.dataset import MeasuredArm
from benchmarks.measured.emps import emps
from benchmarks.measured.kinova import kinova
from benchmarks.measured.kuka import kuka
from benchmarks.measured.odrive import odrive
from benchmarks.measured.panda import panda
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.drives import judge_drives
from estimator.diagnosis.gears import judge_gears
from estimator.diagnosis.telling.answer import Diagnosis, Finding

SLOW_SWEEP = "odrive_slow2_slower_nocomp_0"
"""One turn in 33 s. Faster sweeps begin with a leap back to zero at 80 rad/s, which a cogging torque is nothing to."""


def diagnosed(arm: MeasuredArm, recordings: Sequence[str], judging: Sequence[str] = ()) -> Diagnosis:
    """Of an arm's recordings by name."""
    return diagnose(arm.body, [arm.recordings[k] for k in recordings], [arm.recordings[k] for k in judging])


@cache
def emps_diagnosed() -> Diagnosis:
    """Learnt from the motion with force pulses, judged on the one without."""
    return diagnosed(emps(), ["emps_pulses"], ["emps"])


@cache
def odrive_diagnosed() -> Diagnosis:
    return diagnosed(odrive(), [SLOW_SWEEP])


def kuka_diagnosed() -> Diagnosis:
    return diagnosed(kuka(), ["kuka_A", "kuka_B", "kuka_C"])


def panda_diagnosed() -> Diagnosis:
    return diagnosed(panda(), ["panda_first_half"], ["panda_second_half"])


def kinova_drives() -> tuple[Finding, ...]:
    """Between the motors' currents and the joints' torque sensors."""
    arm = kinova()
    sensors = list(arm.recordings.values())
    motors = [replace(sensor, tau=arm.motors[name]) for name, sensor in arm.recordings.items()]
    return judge_drives(arm.body, motors, sensors).findings


def kuka_gears() -> tuple[Finding, ...]:
    """Between the encoders of the motors and those on the links, of axes 1–3."""
    arm = kuka("link")
    return judge_gears(arm.body, list(arm.recordings.values()), list(arm.motor_angles.values())).findings


def findings_of(found: Diagnosis, effect: str, joint: int | None = None) -> list[Finding]:
    """Those of one effect, at one joint if given, most evidence first."""
    return [f for f in found.findings if f.effect == effect and joint in (None, f.place.joint)]


def number(finding: Finding, parameter: str) -> float:
    """A parameter's value."""
    return float(np.asarray(finding.parameters[parameter].value))
