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
from learner.linearisation import linearise, spread
from learner.trial import Timing
from service.practice.course import PracticeArguments
from service.practice.inverse_models import ArmTorques, load_inverse_model
from service.practice.planning import Practised, practised_motion
from service.practice.record import read_feedforward
from service.practice.taught import Taught, at_torques, base_torque, what_was_taught
from service.sessions.store import SessionStore

Array = NDArray[np.float64]
INSTANTS = 16
PRACTISED = "-practise"
"""What the ids of sessions that practised contain."""


def plan_with_feedforward(motion: str, installation: Installation, mode: Mode, source: str) -> Plan:
    """The motion, with rests around it as in practice, and the torque that ``source`` has for it.

    ``source``: the CSV that practice left for this very motion; the id of a practice session, whose model with the
    periodic torques that it taught serves any motion, and whose local model of the rest serves this one where it comes
    near the practised one (Section 7.1); else a model by file or name.
    Raises InputError when the motion leaves a limit, or the source is of another arm or motion.
    """
    practised = practised_motion(motion, installation, mode)
    if source.endswith(".csv"):
        return practised.plan(read_feedforward(Path(source), installation.joint_names, practised.reference.samples))
    if PRACTISED in source:
        taught, timing = _learnt(source, installation, mode)
        correction, _ = taught.rest.correction_at(at_torques(practised))
        return _planned(practised, taught.model, correction, timing)
    return plan_by_model(motion, installation, mode, source)


def plan_by_model(motion: str, installation: Installation, mode: Mode, model: str | None) -> Plan:
    """The motion, with rests around it as in practice, and a model's torque for it: of that file or name, or the arm's
    URDF. Raises InputError like `plan_with_feedforward`."""
    practised = practised_motion(motion, installation, mode)
    inverse = load_inverse_model(model, installation)
    return _planned(practised, inverse, np.zeros_like(practised.reference.q), practised.timing)


def _planned(practised: Practised, model: ArmTorques, correction: Array, timing: Timing) -> Plan:
    """``correction``: N·m (samples, n) beside the model's torque."""
    reference = practised.reference
    at = spread(reference.samples, INSTANTS)
    arm = linearise(model.momentary, reference.q[at], reference.dq[at], reference.ddq[at])
    torque = constrained(
        base_torque(model, practised) + correction,
        reference.q,
        reference.dq,
        arm,
        practised.loop,
        practised.limits,
        practised.name,
    )
    return practised.plan(timing.command(torque))


def _learnt(session_id: str, installation: Installation, mode: Mode) -> tuple[Taught, Timing]:
    """What a practice session that came to its end has taught, and the torque's timing."""
    session = SessionStore(state_directory(), installation.arm.name).open(session_id)
    result = session.result()
    if session.record.kind != "practise" or result is None:
        raise InputError(f"session {session_id}", "has learnt nothing to its end", "name one that is done")
    asked = PracticeArguments.model_validate(session.record.arguments)
    if asked.mode != mode:
        raise InputError(f"session {session_id}", f"practised in {asked.mode}", f"add --mode {asked.mode}")
    practised = practised_motion(asked.motion, installation, mode)
    names = installation.joint_names
    lag = np.array([result["actuation_lag_cycles"][name] for name in names])
    sent = read_feedforward(Path(result["feedforward"]), names, practised.reference.samples)
    acted = Timing(practised.timing.held, -lag).command(sent)
    model = load_inverse_model(asked.model, installation)
    found = what_was_taught(model, practised, acted, asked.learnt_up_to(result["certificate"]["band_hz"]))
    return found, Timing(practised.timing.held, lag)
