"""Which of the known loads it is, and whether it is the one it should be."""

from __future__ import annotations

from typing import Any

from estimator.loads import RigidLoad, recognise, verify
from estimator.loads.recognition import CALIBRATION
from service.identification.load_file import read_loads, read_one_load
from service.identification.request import LoadRequest


def judged(load: RigidLoad, request: LoadRequest) -> dict[str, Any]:
    """Entries ``recognition`` and ``verification`` of the answer, each None where it was not asked for.

    Raises InputError for files of loads that cannot be read, or when the load's mass is not told.
    """
    recognition = verification = None
    if request.library is not None:
        r = recognise(load, read_loads(request.library))
        recognition = {
            "verdict": r.verdict,
            "name": r.name,
            "p_values": dict(r.p_values),
            "false_rejection": r.false_rejection,
            "calibration_error": CALIBRATION,
            "confusion": r.confusion,
        }
    if request.expect is not None:
        nominal = read_one_load(request.expect)
        v = verify(load, nominal, request.tolerance.mass_kg, request.tolerance.centre_m)
        verification = {
            "verdict": v.verdict,
            "expected": nominal.name,
            "mass_tolerance": request.tolerance.mass_kg,
            "centre_tolerance": request.tolerance.centre_m,
            "false_acceptance": v.false_acceptance,
            "false_rejection": v.false_rejection,
            "power": v.power,
        }
    return {"recognition": recognition, "verification": verification}


def is_no(answer: dict[str, Any]) -> bool:
    """Whether the answer is no: not the expected load for certain, or none of the known ones."""
    recognition, verification = answer["recognition"], answer["verification"]
    return bool(
        (verification is not None and verification["verdict"] != "accepted")
        or (recognition is not None and recognition["verdict"] == "unknown")
    )
