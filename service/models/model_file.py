"""The model file: an arm's links and effects as TOML, with their errors, and what they were learnt from.

It stands by itself: the URDF that gives kinematics and joints is inside. A file is never changed; a model that
extends another is the next version, with its parent's content address.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from config import InputError
from config.text_file import read_text
from estimator.arm_model import ArmModel, FittedEffect, identified_model
from estimator.diagnosis.evidence.design import Hypothesis
from estimator.diagnosis.telling.quantities import unit_of
from estimator.effects import Effect, Parameters, Place, effect
from estimator.identification import LinkIdentification
from estimator.rigid_body import RigidBody, load_rigid_body
from service.identification.recorded import Source
from service.models.toml_text import block, keys, literal
from service.sessions.store import write_atomically

FORMAT: Literal[2] = 2
REMEDY = "give a model file written by etude"
Number = float | tuple[float, ...]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Quantity(_Section):
    """A value with its standard error (absent where the data say nothing about it)."""

    name: str
    value: float
    standard_error: float | None = None
    unit: str


class Parameter(_Section):
    """Of an effect: numbers, or vectors of one length."""

    value: Number
    standard_error: Number | None = None
    unit: str

    @model_validator(mode="after")
    def _of_one_length(self) -> Self:
        if self.standard_error is not None and np.shape(self.standard_error) != np.shape(self.value):
            raise ValueError("value and standard_error have not as many numbers")
        return self


class EffectEntry(_Section):
    """An effect of the catalogue where it was found. ``shape``: how sharp its signs are (`Effect.hidden`)."""

    name: str
    joint: str | None = None
    joint_other: str | None = None
    channel: str | None = None
    shape: tuple[float, ...] | None = None
    parameter: dict[str, Parameter] = Field(default_factory=dict)

    @property
    def where(self) -> str:
        """In words: ``joint1 with joint2``, ``joint1, position``, ``arm``."""
        joints = " with ".join(name for name in (self.joint, self.joint_other) if name)
        return ", ".join(filter(None, (joints, self.channel))) or "arm"


class LearntFrom(_Section):
    path: str
    sha256: str
    samples: int
    duration_s: float


class ModelFile(_Section):
    """``link_parameters``: ten a link (m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link's frame). Of
    identified links they have the identified base parameters and lie nearest the URDF's; no promise that each is a
    body."""

    format: Literal[2]
    kind: Literal["model"]
    arm: str
    version: int = Field(ge=1)
    parent: str | None = None
    """What it extends: ``model:`` or ``urdf:`` and the SHA-256 of its text."""
    joints: tuple[str, ...]
    held: dict[str, float] = Field(default_factory=dict)
    gravity_m_s2: tuple[float, float, float]
    status: str
    """How it came about, in words."""
    estimator: str | None = None
    band_hz: float | None = None
    link_parameters: dict[str, tuple[float, ...]]
    effect: tuple[EffectEntry, ...] = ()
    base_parameter: tuple[Quantity, ...] = ()
    learnt_from: tuple[LearntFrom, ...] = ()
    urdf: str

    @property
    def address(self) -> str:
        """What a child calls it."""
        return f"model:{sha256(model_text(self).encode()).hexdigest()}"


def urdf_address(body: RigidBody) -> str:
    """The parent of a model that extends a URDF."""
    return f"urdf:{sha256(body.urdf.encode()).hexdigest()}"


def model_file(
    arm: str,
    model: ArmModel,
    status: str,
    sources: Sequence[Source],
    version: int = 1,
    parent: str | None = None,
    **more: Any,
) -> ModelFile:
    """The file of a model. ``more``: ``estimator``, ``band_hz`` and ``base_parameter`` of an identification."""
    body = model.body
    rows = body.prior().reshape(body.n, 10)
    return ModelFile(
        format=FORMAT,
        kind="model",
        arm=arm,
        version=version,
        parent=parent or urdf_address(body),
        joints=body.joints,
        held=dict(body.held),
        gravity_m_s2=tuple(body.gravity.tolist()),
        status=status,
        link_parameters={name: tuple(row.tolist()) for name, row in zip(body.joints, rows, strict=True)},
        effect=tuple(_entry(one, body) for one in model.effects),
        learnt_from=tuple(LearntFrom(**asdict(source)) for source in sources),
        urdf=body.urdf,
        **more,
    )


def link_model_file(arm: str, result: LinkIdentification, sources: Sequence[Source]) -> ModelFile:
    """The file of identified links."""
    return model_file(
        arm,
        identified_model(result),
        result.status,
        sources,
        estimator=result.estimator,
        band_hz=result.band,
        base_parameter=tuple(Quantity.model_validate(row) for row in result.as_json()["base_parameters"]),
    )


def arm_model(file: ModelFile) -> ArmModel:
    """The model of a file. Raises InputError when an effect or a joint is not known, or a link's row is not ten."""
    body = load_rigid_body(file.urdf, file.joints, file.held, file.gravity_m_s2)
    rows = [file.link_parameters.get(name, ()) for name in file.joints]
    wrong = [name for name, row in zip(file.joints, rows, strict=True) if len(row) != 10]
    if wrong:
        raise InputError(f"link_parameters.{wrong[0]}", "has not ten numbers", REMEDY)
    effects = tuple(_fitted(entry, body) for entry in file.effect)
    return ArmModel(body.with_parameters(np.ravel(rows)), effects)


def write_model(path: Path, file: ModelFile) -> None:
    """Write the model file. Raises InputError when it cannot be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, model_text(file))
    except OSError as error:
        raise InputError(str(path), f"the model cannot be written ({error.strerror})", "check the directory") from None


def read_model(path: Path) -> ModelFile:
    """A model file. Raises InputError naming file and key when it is none."""
    try:
        return ModelFile.model_validate(tomllib.loads(read_text(path)))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"cannot be read ({error})", REMEDY) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), f"is not valid TOML: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(str(path), f"{key}: {first['msg'].removeprefix('Value error, ')}", REMEDY) from None


def model_text(file: ModelFile) -> str:
    """The file as TOML."""
    tables = {"link_parameters", "effect", "base_parameter", "learnt_from", "urdf", "held"}
    lines = [
        "# A model of an arm by etude: tau = inverse dynamics of the links + sum of the effects. SI units.",
        *keys(file.model_dump(exclude=tables)),
        *([f"held = {literal(file.held)}"] if file.held else []),
        f"urdf = {block(file.urdf)}",
        "",
        "[link_parameters]  # m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the link's frame",
        *(f"{literal(name)} = {literal(row)}" for name, row in file.link_parameters.items()),
    ]
    for entry in file.effect:
        lines += ["", "[[effect]]", *keys(entry.model_dump(exclude={"parameter"}))]
        for name, parameter in entry.parameter.items():
            lines += [f"parameter.{name} = {literal(parameter.model_dump(exclude_none=True))}"]
    rows: Sequence[tuple[str, Sequence[_Section]]] = (
        ("base_parameter", file.base_parameter),
        ("learnt_from", file.learnt_from),
    )
    for table, entries in rows:
        for row in entries:
            lines += ["", f"[[{table}]]", *keys(row.model_dump())]
    return "\n".join(lines) + "\n"


def _entry(one: FittedEffect, body: RigidBody) -> EffectEntry:
    def name(joint: int | None) -> str | None:
        return None if joint is None else body.joints[joint]

    hypothesis = Hypothesis(effect(one.name).of(one.parameters), one.place)
    return EffectEntry(
        name=one.name,
        joint=name(one.place.joint),
        joint_other=name(one.place.other),
        channel=one.place.channel,
        shape=None if one.shape is None else tuple(one.shape.tolist()),
        parameter={
            key: Parameter(
                value=_number(value),
                standard_error=_error(one.standard_error, key),
                unit=unit_of(hypothesis, key, one.parameters, body),
            )
            for key, value in one.parameters.items()
            if key != "joint_other"
        },
    )


def _fitted(entry: EffectEntry, body: RigidBody) -> FittedEffect:
    found = effect(entry.name)
    for joint in (entry.joint, entry.joint_other):
        if joint is not None and joint not in body.joints:
            raise InputError(f"effect {entry.name}", f"the arm has no joint {joint!r}", f"use {', '.join(body.joints)}")
    found = found.of(entry.parameter)
    unknown = sorted(set(entry.parameter) - set(found.units))
    if unknown:
        raise InputError(f"effect {entry.name}", f"has no {unknown[0]!r}", f"it has {', '.join(found.units)}")
    index = {name: k for k, name in enumerate(body.joints)}
    other = None if entry.joint_other is None else index[entry.joint_other]
    place = Place(None if entry.joint is None else index[entry.joint], entry.channel, other)
    parameters = {key: _value(one.value) for key, one in entry.parameter.items()}
    if other is not None:
        parameters["joint_other"] = float(other)
    errors = {key: _value(one.standard_error) for key, one in entry.parameter.items() if one.standard_error is not None}
    _possible(found, parameters)
    _complete(found, place, parameters)
    if entry.shape is not None and len(entry.shape) != len(found.hidden):
        told = f"has a shape of {len(entry.shape)} numbers"
        raise InputError(f"effect {entry.name}", told, f"give {len(found.hidden)}, or none for a sharp one")
    if place not in found.places(body):
        raise InputError(f"effect {entry.name}", f"is none of {entry.where}", "name a joint and a channel that it has")
    for value, k in zip(entry.shape or (), found.hidden, strict=False):
        # A width, a share, an inertia, or a choice, which counts from zero.
        if not 0.0 <= value < math.inf:
            told = f"has the shape {value:g} at {entry.where}"
            raise InputError(f"effect {entry.name}", told, "give numbers of zero or more, as they were fitted")
        if value not in (allowed := found.choices_at(place).get(k, (value,))):
            told = f"has the shape {value:g} at {entry.where}"
            raise InputError(f"effect {entry.name}", told, f"it is one of {', '.join(f'{x:g}' for x in allowed)}")
    shape = None if entry.shape is None else np.array(entry.shape)
    return FittedEffect(entry.name, place, parameters, errors, shape)


def _possible(found: Effect, parameters: Parameters) -> None:
    """Raises InputError where a parameter is no number, or none that a thing of the effect's name has."""
    for key, value in parameters.items():
        if not np.all(np.isfinite(value)):
            raise InputError(f"effect {found.name}", f"{key!r} is no finite number", REMEDY)
        if key in found.above_zero and np.any(np.asarray(value) <= 0.0):
            raise InputError(f"effect {found.name}", f"{key!r} is {value:g}", "give more than zero")


def _complete(found: Effect, place: Place, parameters: Parameters) -> None:
    """Raises InputError where a parameter is missing, or has not as many numbers as the effect takes."""
    try:
        taken = found.parameters(place, *found.unknowns(place, parameters))
    except KeyError as missing:
        raise InputError(f"effect {found.name}", f"lacks {missing.args[0]!r}", REMEDY) from None
    except (ValueError, TypeError, IndexError):
        raise InputError(f"effect {found.name}", "its parameters have too few or too many numbers", REMEDY) from None
    wrong = next((key for key, value in parameters.items() if np.size(value) != np.size(taken.get(key, value))), None)
    if wrong is not None:
        raise InputError(f"effect {found.name}", f"{wrong!r} has too few or too many numbers", REMEDY)


def _error(errors: Mapping[str, Any], key: str) -> Number | None:
    """None for what is not finite: TOML has NaN, an answer should not."""
    if key not in errors or not np.all(np.isfinite(errors[key])):
        return None
    return _number(errors[key])


def _number(value: Any) -> Number:
    return tuple(np.ravel(value).tolist()) if np.ndim(value) else float(value)


def _value(number: Number) -> Any:
    return np.array(number) if isinstance(number, tuple) else number
