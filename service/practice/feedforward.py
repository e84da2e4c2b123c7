"""A motion with feedforward: a model's torque for it, or what practice has learnt."""

from __future__ import annotations

from pathlib import Path

from config import Installation
from config.schema import Mode
from driver.plan import Plan
from learner.constrained import constrained
from learner.linearisation import linearise, spread
from service.practice.inverse_models import load_inverse_model
from service.practice.planning import practised_motion
from service.practice.record import read_feedforward

INSTANTS = 16


def plan_with_feedforward(motion: str, installation: Installation, mode: Mode, source: str) -> Plan:
    """The motion, with rests around it as in practice, and the torque that ``source`` has for it.

    Raises InputError when the motion leaves a limit, or the source is of another arm or motion.
    """
    practised = practised_motion(motion, installation, mode)
    reference = practised.reference
    if source.endswith(".csv"):
        return practised.plan(read_feedforward(Path(source), installation.joint_names, reference.samples))
    model = load_inverse_model(source, installation)
    at = spread(reference.samples, INSTANTS)
    arm = linearise(model.momentary, reference.q[at], reference.dq[at], reference.ddq[at])
    wanted = model.torque(reference.q, reference.dq, reference.ddq)
    torque = constrained(wanted, reference.q, reference.dq, arm, practised.loop, practised.limits, practised.name)
    return practised.plan(practised.timing.command(torque))
