"""A motion with feedforward: a model's torque for it, what practice has learnt on it, or what it learnt nearby."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.paths import state_directory
from config.schema import Mode
from driver.plan import Plan
from learner.constrained import constrained
from learner.kinematics import Kinematics
from learner.linearisation import linearise, spread
from learner.local_model import LocalModel, States
from learner.trial import Reference, Timing
from service.practice.course import PracticeArguments
from service.practice.inverse_models import ArmTorques, load_inverse_model
from service.practice.planning import Practised, practised_motion
from service.practice.record import read_feedforward
from service.sessions.store import SessionStore

Array = NDArray[np.float64]
INSTANTS = 16
PRACTISED = "-practise"
"""What the ids of sessions that practised contain."""


def plan_with_feedforward(motion: str, installation: Installation, mode: Mode, source: str) -> Plan:
    """The motion, with rests around it as in practice, and the torque that ``source`` has for it.

    ``source``: the CSV that practice left for this very motion; the id of a practice session, whose model and local
    model serve this motion where it comes near the practised one (Section 7.1); else a model by file or name.
    Raises InputError when the motion leaves a limit, or the source is of another arm or motion.
    """
    practised = practised_motion(motion, installation, mode)
    reference = practised.reference
    if source.endswith(".csv"):
        return practised.plan(read_feedforward(Path(source), installation.joint_names, reference.samples))
    timing = practised.timing
    if PRACTISED in source:
        model, local, timing = _learnt(source, installation, mode)
        correction, _ = local.correction_at(States(reference.q, reference.dq, reference.ddq))
    else:
        model, correction = load_inverse_model(source, installation), np.zeros_like(reference.q)
    at = spread(reference.samples, INSTANTS)
    arm = linearise(model.momentary, reference.q[at], reference.dq[at], reference.ddq[at])
    torque = constrained(
        _base(model, practised) + correction,
        reference.q,
        reference.dq,
        arm,
        practised.loop,
        practised.limits,
        practised.name,
    )
    return practised.plan(timing.command(torque))


def _learnt(session_id: str, installation: Installation, mode: Mode) -> tuple[ArmTorques, LocalModel, Timing]:
    """Model, local model and the torque's timing of a practice session that came to its end."""
    session = SessionStore(state_directory(), installation.arm.name).open(session_id)
    result = session.result()
    if session.record.kind != "practise" or result is None:
        raise InputError(f"session {session_id}", "has learnt nothing to its end", "name one that is done")
    asked = PracticeArguments.model_validate(session.record.arguments)
    if asked.mode != mode:
        raise InputError(f"session {session_id}", f"practised in {asked.mode}", f"add --mode {asked.mode}")
    practised = practised_motion(asked.motion, installation, mode)
    r = practised.reference
    model = load_inverse_model(asked.model, installation)
    names = installation.joint_names
    lag = np.array([result["actuation_lag_cycles"][name] for name in names])
    sent = read_feedforward(Path(result["feedforward"]), names, r.samples)
    acted = Timing(practised.timing.held, -lag).command(sent)
    part = slice(r.moving.start, r.moving.stop)
    local = LocalModel(States(r.q[part], r.dq[part], r.ddq[part]), (acted - _base(model, practised))[part])
    return model, local, Timing(practised.timing.held, lag)


def _base(model: ArmTorques, practised: Practised) -> Array:
    """The model's torque for the reference, in time with a trial's torque."""
    reference: Reference = practised.reference
    exact = Kinematics(reference.period, held=practised.timing.held, flat_hz=None)
    return model.torque(*exact.at_torques(reference.q, reference.dq))
