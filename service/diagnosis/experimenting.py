"""What would decide an ambiguous finding: a motion, as a file that the arm can play, or the drives read while off."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from config import InputError
from estimator.diagnosis.deciding.experiment import Experiment, design_experiment
from estimator.diagnosis.deciding.experiment_motions import ExperimentMotion
from estimator.diagnosis.telling.answer import Diagnosis, Finding
from estimator.effects import Place
from service.diagnosis.experiment_limits import limits_and_home
from service.diagnosis.json_answer import experiment
from service.diagnosis.sentences import effect_text, place_text
from service.identification.read import ReadRecordings
from service.sessions.store import write_atomically


def next_experiment(
    diagnosis: Diagnosis, finding: Finding, read: ReadRecordings, directory: Path | None, name: str
) -> dict[str, Any] | None:
    """What would decide a finding: the catalogue's sentence, and the motion, or reading with the drives off, where one
    within the limits decides.

    A motion is written to ``directory`` as ``name``; without one, or without limits, the sentence stands alone.
    None for a finding that is decided.
    """
    if finding.next_experiment is None:
        return None
    sentence = finding.next_experiment
    if finding.contest is None:
        return experiment(sentence)
    limits, home = limits_and_home(read)
    if directory is None or limits is None:
        return experiment(sentence)
    chosen = design_experiment(finding.contest, limits, home)
    if chosen is None:
        return experiment(f"{sentence}; no motion of this arm within its limits decides")
    told = _sentence(chosen, finding, diagnosis.joints)
    if chosen.motion is None:
        designed = experiment(told, predicted_gap=chosen.predicted_gap, drives_off_s=chosen.drives_off_s)
    else:
        path = write_experiment(directory, name, chosen.motion, diagnosis.joints)
        moving = [diagnosis.joints[joint] for joint in chosen.motion.joints]
        designed = experiment(told, str(path), moving, chosen.playings, chosen.predicted_gap)
    return {**designed, "between": between(finding, diagnosis.joints)}


def between(finding: Finding, joints: Sequence[str]) -> list[dict[str, Any]]:
    """The rivals of an ambiguous finding, itself first."""
    places = [(finding.effect, finding.place), *((a.effect, a.place) for a in finding.alternatives)]
    return [{"effect": effect, "joint": _name(place.joint, joints), "other": _name(place.other, joints),
             "channel": place.channel} for effect, place in places]  # fmt: skip


def realised_gap(diagnosis: Diagnosis, rivals: Sequence[dict[str, Any]]) -> float | None:
    """nats by which the nearest of former rivals is now behind the one of them that was found; None when another
    cause has taken the place of all of them."""
    told = {_key(rival) for rival in rivals}
    for finding in diagnosis.findings:
        own = (finding.effect, finding.place)
        if _of(own, diagnosis.joints) not in told:
            continue
        gaps = [
            a.log_likelihood_gap
            for a in finding.rivals
            if _of((a.effect, a.place), diagnosis.joints) in told - {_of(own, diagnosis.joints)}
        ]
        return min(gaps, default=None)
    return None


def write_experiment(directory: Path, name: str, motion: ExperimentMotion, joints: Sequence[str]) -> Path:
    """The motion as its path in CSV and the motion file that names it; returns the motion file.

    Raises InputError when the directory cannot be written.
    """
    header = ",".join(["t", *(f"q_{joint}" for joint in joints)])
    rows = "\n".join(",".join(f"{x:.9g}" for x in row) for row in np.column_stack([motion.t, motion.points]))
    moved = ", ".join(joints[joint] for joint in motion.joints)
    names = ", ".join(f'"{joint}"' for joint in joints)
    path = directory / f"{name}.toml"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        write_atomically(directory / f"{name}.csv", f"{header}\n{rows}\n")
        write_atomically(
            path,
            f'kind = "recorded"\ndescription = "{motion.kind}: {moved}"\njoints = [{names}]\nfile = "{name}.csv"\n',
        )
    except OSError as error:
        raise InputError(str(directory), f"cannot be written ({error.strerror})", "choose another --out") from None
    return path


def _sentence(chosen: Experiment, finding: Finding, joints: Sequence[str]) -> str:
    """Which motion or reading, what it decides, and what it leaves."""
    places = [(finding.effect, finding.place), *((a.effect, a.place) for a in finding.alternatives)]
    if chosen.motion is None:
        text = f"record the torques for {chosen.drives_off_s:g} s with the drives off, the arm held by brakes or a stop"
    else:
        where = ", ".join(joints[joint] for joint in chosen.motion.joints)
        times = "twice" if chosen.playings == 2 else f"{chosen.playings} times"
        text = f"play the {chosen.motion.kind} of {where} {times}"

    def told(place: tuple[str, Place]) -> str:
        return f"{effect_text(place[0])} of {place_text(place[1], joints, verb=False)}"

    if chosen.alike:
        pairs = (f"{told(places[a])} from {told(places[b])}" for a, b in chosen.alike)
        text += f"; no motion within the limits tells {', nor '.join(pairs)}"
    return text


def _name(joint: int | None, joints: Sequence[str]) -> str | None:
    return None if joint is None else joints[joint]


def _key(rival: dict[str, Any]) -> tuple[Any, ...]:
    return rival["effect"], rival["joint"], rival["other"], rival["channel"]


def _of(cause: tuple[str, Place], joints: Sequence[str]) -> tuple[Any, ...]:
    effect, place = cause
    return effect, _name(place.joint, joints), _name(place.other, joints), place.channel
