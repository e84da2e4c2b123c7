"""Appendix A before and after the diagnosis: what joint 3 lacks is named, added to the model, and the gain is measured.

All controllers play the appendix' motion on the stand-in direct drive arm, through the wire, with the identified links;
the identification's and the comparison's own recordings are diagnosed against those links; then all play it again.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.bench_practice import ARM, up
from benchmarks.figure import Figure
from config import load_installation
from estimator import RigidBody
from estimator.arm_model import diagnosed_model
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis
from service.identification.read import ReadRecordings, read_recordings
from service.models.model_file import model_file, write_model
from service.practice.inverse_models import load_inverse_model

MOTION, JOINT, SLOW_HZ = "dda-controllers", "joint3", 133.0
TOLERANCE = 0.02
"""Share to which the identified links are believed."""
COMPARED = (("hybrid", "full dynamics", 1000.0), ("digital", "feedforward", SLOW_HZ))


def measure() -> list[Figure]:
    with up(0) as daemon:
        links = daemon.call("identify_links")
        before = daemon.call("compare_controllers", {"motion": MOTION, "model": links["model"]})
        played = Path(before["plot"]).parent.glob("*.mcap")
        model = _extended(links["model"], [*map(Path, links["recordings"]), *sorted(played)])
        after = daemon.call("compare_controllers", {"motion": MOTION, "model": str(model)})
    figures = []
    for family, name, rate in COMPARED:
        servo = "PD" if family == "digital" else "position and velocity reference"
        bodies = _row(after, family, name, rate)
        whole = _row(after, family, f"{name} and named effects", rate)
        alone = _row(after, family, servo, rate)
        for kind in ("peak_deg", "rms_deg"):
            label = f"appendix_a ({JOINT}, {family}, {kind.removesuffix('_deg')})"
            figures.append(Figure(f"{label} rigid bodies", bodies[kind][JOINT], "°", servo, alone[kind][JOINT]))
            figures.append(Figure(f"{label} diagnosed", whole[kind][JOINT], "°", "rigid bodies", bodies[kind][JOINT]))
    return figures


def diagnosed(links: str, recordings: list[Path]) -> tuple[RigidBody, Diagnosis, ReadRecordings]:
    """The identified links, what the recordings show that they lack, and the recordings."""
    body = load_inverse_model(links, load_installation(ARM)).model.body
    read = read_recordings(tuple(recordings), (), ARM, {}, "/joint_states", lambda stage, share: None)
    return body, diagnose(body, read.trajectories, (), TOLERANCE), read


def _extended(links: str, recordings: list[Path]) -> Path:
    """The links with what the recordings show that they lack; a model file beside theirs."""
    body, found, read = diagnosed(links, recordings)
    places = ["the arm" if one.place.joint is None else body.joints[one.place.joint] for one in found.findings]
    told = ", ".join(f"{one.effect} of {place}" for one, place in zip(found.findings, places, strict=True))
    print(f"named beside the identified links: {told}")
    path = Path(links).with_name("diagnosed.toml")
    write_model(path, model_file(ARM, diagnosed_model(body, found), found.verdict, read.sources))
    return path


def _row(answer: dict[str, Any], family: str, name: str, rate: float) -> dict[str, Any]:
    rows: list[dict[str, Any]] = answer["controllers"]
    return next(r for r in rows if (r["family"], r["controller"], r["rate_hz"]) == (family, name, rate))
