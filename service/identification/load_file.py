"""Files of known loads: TOML with a ``[[load]]`` for each, written by an identification or by hand."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from config import InputError
from config.text_file import read_text
from config.toml_file import with_tuples
from estimator.loads.parameters import RigidLoad, rigid_load
from service.identification.recorded import Source
from service.models.model_file import LearntFrom
from service.models.toml_text import literal
from service.sessions.store import write_atomically

FORMAT = 1
Row = Annotated[tuple[float, ...], Field(min_length=10, max_length=10)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class KnownLoad(_Section):
    """SI units, in the sensor's frame. Without ``inertia`` only mass and centre are known; without ``covariance``
    (of m, mcx … Izz about the frame's origin) what is given is exact."""

    name: str
    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float] | None = None
    """xx xy xz yy yz zz about the centre."""
    covariance: Annotated[tuple[Row, ...], Field(min_length=10, max_length=10)] | None = None


class LoadFile(_Section):
    """``load.toml``."""

    format: Literal[1]
    kind: Literal["loads"]
    arm: str | None = None
    frame: str | None = None
    load: Annotated[tuple[KnownLoad, ...], Field(min_length=1)]
    learnt_from: tuple[LearntFrom, ...] = ()


def read_loads(path: Path) -> list[RigidLoad]:
    """The loads of a file. Raises InputError naming file and key when it is none."""
    remedy = 'write format = 1, kind = "loads", and for each [[load]] name, mass, centre, inertia'
    try:
        file = LoadFile.model_validate(with_tuples(tomllib.loads(read_text(path))), strict=True)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"cannot be read ({error})", "give a file of loads") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), f"is not valid TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(str(path), f"{key}: {first['msg']}", remedy) from None
    return [_load(path, known) for known in file.load]


def read_one_load(path: Path) -> RigidLoad:
    """The load of a file with a single one. Raises InputError when there are several."""
    loads = read_loads(path)
    if len(loads) > 1:
        names = ", ".join(load.name for load in loads)
        raise InputError(str(path), f"has several loads ({names})", "give a file with the one that is meant")
    return loads[0]


def _load(path: Path, known: KnownLoad) -> RigidLoad:
    if not known.mass > 0.0:
        raise InputError(str(path), f"load {known.name} weighs {known.mass:g} kg", "give a mass above zero")
    covariance = np.zeros((10, 10)) if known.covariance is None else np.array(known.covariance)
    if known.inertia is None:
        load = rigid_load(known.mass, np.array(known.centre), np.zeros(6), covariance, known.name)
        parameters = load.parameters.copy()
        parameters[4:] = np.nan
        covariance[4:], covariance[:, 4:] = np.nan, np.nan
        covariance[range(4, 10), range(4, 10)] = np.inf
        return RigidLoad(parameters, covariance, known.name)
    return rigid_load(known.mass, np.array(known.centre), np.array(known.inertia), covariance, known.name)


def write_load(path: Path, arm: str, frame: str, load: RigidLoad, sources: Sequence[Source]) -> None:
    """Write one identified load. Raises InputError when it cannot be written."""
    inertia = load.inertia.value
    entries = {
        "name": load.name,
        "mass": float(load.mass.value),
        "centre": load.centre.value.tolist(),
        "inertia": inertia.tolist() if np.isfinite(inertia).all() else None,
        "covariance": load.covariance.tolist(),
    }
    lines = [
        "# A load identified by etude. SI units, in the sensor's frame; covariance of m, mc and I about its origin.",
        f"format = {FORMAT}",
        'kind = "loads"',
        f"arm = {literal(arm)}",
        f"frame = {literal(frame)}",
        "",
        "[[load]]",
        *(f"{key} = {literal(value)}" for key, value in entries.items() if value is not None),
    ]
    for source in sources:
        lines += ["", "[[learnt_from]]", *(f"{key} = {literal(value)}" for key, value in asdict(source).items())]
    try:
        write_atomically(path, "\n".join(lines) + "\n")
    except OSError as error:
        raise InputError(str(path), f"the load cannot be written ({error.strerror})", "check the directory") from None
