"""What the diagnosis names on recordings that others measured, beside what their authors publish.

Where an author published a value the figure is the diagnosis' value beside it; ``0`` stands for a cause that is
published and not named. Data sets that are not in ../shared/data are left out.

Draws ``docs/pictures/causes.png``, where both of its data sets are there.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.figure import Figure
from benchmarks.measured import emps, is_here
from benchmarks.measured.causes_picture import draw
from benchmarks.measured.diagnosed import (
    emps_diagnosed,
    findings_of,
    kinova_drives,
    kuka_diagnosed,
    kuka_gears,
    number,
    odrive_diagnosed,
    panda_diagnosed,
)
from benchmarks.measured.emps import response_to_pulses
from estimator.convolution import convolve
from estimator.diagnosis.telling.answer import Diagnosis, Finding
from estimator.filtering import plan_filter

EMPS = {
    "coefficient_positive": ("N·s/m", 166.706),
    "coefficient_negative": ("N·s/m", 240.424),
    "level_positive": ("N", 20.144),
    "level_negative": ("N", 20.628),
}
EMPS_MASS = 95.154
"""kg, published."""
PULSES_TELL = (20.0, 100.0)
"""Hz: below, the motion is in the way; beyond, the recorded position falls off, and at 230 Hz nothing is left of it."""
STIFFNESS = (4.58e6, 7.52e6, 4.10e6)
"""N·m/rad, of the KUKA's axes 1–3."""
ORDERS = (7, 28, 14, 36, 12, 84)
"""A turn, of the ODrive's motor, the strongest first."""
FRICTION = (
    "coulomb_friction",
    "viscous_friction",
    "asymmetric_friction",
    "stribeck_friction",
    "presliding",
    "friction_drift",
    "load_dependent_friction",
)


def measure() -> list[Figure]:
    figures: list[Figure] = []
    for folder, of_set in (
        ("emps", _emps),
        ("odrive_cogging", _odrive),
        ("kuka_kr300", _kuka),
        ("franka_panda", _panda),
        ("kinova_gen3", _kinova),
    ):
        if is_here(folder):
            figures += of_set()
        else:
            print(f"{folder} is not in ../shared/data: left out", file=sys.stderr)
    if is_here("emps") and is_here("odrive_cogging"):
        draw([("EMPS drive (slide)", emps_diagnosed()), ("ODrive motor", odrive_diagnosed())])
    return figures


def _emps() -> list[Figure]:
    found = emps_diagnosed()
    own = findings_of(found, "asymmetric_friction")
    return [
        *(
            Figure(f"diagnosed_emps_{name}", number(own[0], name) if own else 0.0, unit, "published", value)
            for name, (unit, value) in EMPS.items()
        ),
        Figure("diagnosed_emps_relative_error", 100.0 * found.held_out.after / _power(found), "%", "published", 3.1117),
        Figure("diagnosed_emps_elastic", float(len(findings_of(found, "joint_elasticity"))), "named", "published", 1.0),
        *pulses(),
        *_sum("emps", found),
    ]


def pulses() -> list[Figure]:
    """What acceleration the pulses bring, as a share of a rigid mass': more than one of a load on a spring."""
    told = response_to_pulses(EMPS_MASS)
    within = told.ratio[(told.frequency > PULSES_TELL[0]) & (told.frequency < PULSES_TELL[1])]
    return [
        Figure(f"emps_pulses_accelerate_{name}", float(value), "of a rigid mass", "a rigid mass", 1.0)
        for name, value in (("least", within.min()), ("most", within.max()))
    ]


def _power(found: Diagnosis) -> float:
    """N: rms of the force of the motion that was held out, in the compared band."""
    judged = emps().recordings["emps"]
    return float(np.sqrt(np.mean(convolve(judged.tau, plan_filter(judged.rate, found.band).smooth) ** 2)))


def _odrive() -> list[Figure]:
    found = odrive_diagnosed()
    orders = [number(finding, "order") for finding in findings_of(found, "cogging")]
    nearest = [min(orders, key=lambda k: abs(k - order), default=0.0) for order in ORDERS]
    own = [
        Figure(
            f"diagnosed_odrive_order_{order}", k if abs(k - order) < 0.5 else 0.0, "1/turn", "published", float(order)
        )
        for order, k in zip(ORDERS, nearest, strict=True)
    ]
    return [*own, *_sum("odrive", found)]


def _kuka() -> list[Figure]:
    found, gears = kuka_diagnosed(), kuka_gears()
    figures = []
    for joint, published in enumerate(STIFFNESS):
        own = [f for f in gears if f.effect == "joint_elasticity" and f.place.joint == joint]
        value = number(own[0], "stiffness") if own else 0.0
        figures.append(Figure(f"diagnosed_kuka_stiffness_{joint + 1}", value, "N·m/rad", "published", published))
    late = [number(f, "delay") for f in gears if f.effect == "transport_delay" and f.place.joint is None]
    figures.append(Figure("diagnosed_kuka_link_angles_late", 1e3 * sum(late), "ms", "none published", None))
    spring = float(len(findings_of(found, "joint_spring", 1)))
    return [*figures, Figure("diagnosed_kuka_counterbalance", spring, "named", "published", 1.0), *_sum("kuka", found)]


def _panda() -> list[Figure]:
    found = panda_diagnosed()
    late = [f for f in findings_of(found, "transport_delay") if f.place.channel == "velocity"]
    delay = 1e3 * number(late[0], "delay") if late else 0.0
    return [Figure("diagnosed_panda_velocity_late", delay, "ms", "published: a few ms", None), *_sum("panda", found)]


def _kinova() -> list[Figure]:
    """Between the motors' currents and the joints' sensors, joint by joint; nothing is published of it."""
    return [
        Figure(
            f"drive_kinova_{finding.effect}_{name}_{_number_of(finding)}",
            float(np.asarray(quantity.value)),
            quantity.unit,
            "standard error",
            float(np.asarray(quantity.standard_error)),
        )
        for finding in kinova_drives()
        for name, quantity in finding.parameters.items()
    ]


def _number_of(finding: Finding) -> str:
    """Of its joint, from one."""
    return "all" if finding.place.joint is None else str(finding.place.joint + 1)


def _sum(name: str, found: Diagnosis) -> list[Figure]:
    """In how many joints friction is named, how many causes in all, and what is left where it was not learnt."""
    rubbing = {f.place.joint for f in found.findings if f.effect in FRICTION}
    joints, held = float(len(found.joints)), found.held_out
    return [
        Figure(f"diagnosed_{name}_joints_with_friction", float(len(rubbing)), "joints", "joints in all", joints),
        Figure(f"diagnosed_{name}_causes", float(len(found.findings)), "", "none published", None),
        Figure(f"diagnosed_{name}_held_out_torque", held.after, "rms, N or N·m", "before", held.before),
    ]
