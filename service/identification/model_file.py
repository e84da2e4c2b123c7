"""The model file: identified links as TOML, with their errors and what they were learnt from."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from config import InputError
from estimator.identification import LinkIdentification
from service.identification.recorded import Source
from service.sessions.store import write_atomically

FORMAT = 1


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Quantity(_Section):
    """A value with its standard error (absent where the data say nothing about it)."""

    name: str
    value: float
    standard_error: float | None = None
    unit: str


class JointTerm(_Section):
    """What a joint adds to the rigid body; ``width`` [rad/s or m/s] is the Coulomb sigmoid's."""

    effect: str
    joint: str
    parameter: str
    value: float
    standard_error: float | None = None
    unit: str
    width: float | None = None


class LearntFrom(_Section):
    path: str
    sha256: str
    samples: int
    duration_s: float


class LinkModel(_Section):
    """``links.toml``. ``link_parameters``: ten a link (m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link's
    frame), those with the identified base parameters that lie nearest the URDF's; no promise that each is a body."""

    format: Literal[1]
    kind: Literal["links"]
    arm: str
    joints: tuple[str, ...]
    estimator: str
    band_hz: float
    status: str
    base_parameter: tuple[Quantity, ...]
    joint_term: tuple[JointTerm, ...] = ()
    link_parameters: dict[str, tuple[float, ...]]
    learnt_from: tuple[LearntFrom, ...]


def write_link_model(path: Path, arm: str, result: LinkIdentification, sources: Sequence[Source]) -> None:
    """Write the model file. Raises InputError when it cannot be written."""
    answer = result.as_json()
    full = result.full_parameters(result.body.prior()).reshape(result.body.n, 10)
    head = {
        "format": FORMAT,
        "kind": "links",
        "arm": arm,
        "joints": list(result.body.joints),
        "estimator": result.estimator,
        "band_hz": result.band,
        "status": result.status,
    }
    lines = [
        "# Links identified by etude: tau = regressor · base parameters + joint terms. SI units.",
        *(f"{key} = {literal(value)}" for key, value in head.items()),
        "",
        "[link_parameters]  # m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link's frame",
        *(f"{literal(name)} = {literal(row.tolist())}" for name, row in zip(result.body.joints, full, strict=True)),
    ]
    for table, rows in (
        ("base_parameter", answer["base_parameters"]),
        ("joint_term", answer["effects"]),
        ("learnt_from", [asdict(source) for source in sources]),
    ):
        for row in rows:
            lines += ["", f"[[{table}]]", *(f"{k} = {literal(v)}" for k, v in row.items() if v is not None)]
    try:
        write_atomically(path, "\n".join(lines) + "\n")
    except OSError as error:
        raise InputError(str(path), f"the model cannot be written ({error.strerror})", "check the directory") from None


def read_link_model(path: Path) -> LinkModel:
    """A model file. Raises InputError naming file and key when it is none."""
    try:
        return LinkModel.model_validate(tomllib.loads(path.read_text()))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"cannot be read ({error})", "give a model file written by etude") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), f"is not valid TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(str(path), f"{key}: {first['msg']}", "give a model file written by etude") from None


def literal(value: Any) -> str:
    """A TOML literal. JSON's strings, numbers and arrays of them are TOML's, but for floats that are not finite."""
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, list):
        return "[" + ", ".join(literal(item) for item in value) + "]"
    return json.dumps(value, ensure_ascii=False)
