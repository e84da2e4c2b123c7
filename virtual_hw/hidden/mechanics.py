"""The hidden mechanics of a stand-in arm: one TOML file that nothing outside `virtual_hw` reads.

A table or an array of tables for each kind of law, by the law's name; the classes beside this file hold their keys.
``extends = "other"`` starts from another file: an entry for the same joint, link or sensor replaces the keys it names,
other arrays of tables are lengthened, everything else is replaced.
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from config import InputError, Installation
from config.loader import read_toml, validate
from config.schema import Section
from virtual_hw.hidden.bodies import BaseTilt, InertiaExcess, Link, LinkChange, Payload, SloshingLoad
from virtual_hw.hidden.contact import Push, Wall
from virtual_hw.hidden.friction import Friction
from virtual_hw.hidden.joint_sensors import AngleSensor, TorqueSensor, VelocitySensor
from virtual_hw.hidden.motor import Motor
from virtual_hw.hidden.noise import Noise
from virtual_hw.hidden.periodic import Cogging, GearMesh, TorqueRipple
from virtual_hw.hidden.springs import CableHysteresis, HydraulicCounterbalance, JointSpring
from virtual_hw.hidden.transmission import Elasticity, RotorInertia, SharedTransmission
from virtual_hw.hidden.wrench_sensor import WrenchErrors

HERE = Path(__file__).parent
SENSOR_NOISE = 2e-4
"""Of a wrist sensor's range, rms, where nothing else is said of it."""


class HiddenMechanics(Section):
    """Everything that makes the stand-in arm another arm than its URDF."""

    description: str = ""
    tick_us: Literal[250, 500, 1000] = 1000
    """The drives' servo tick."""
    substeps: Annotated[int, Field(ge=1, le=20)] = 1
    """Steps of the mechanics in a tick; more for stiff elastic joints."""

    link: tuple[Link, ...] = ()
    link_change: tuple[LinkChange, ...] = ()
    inertia_excess: tuple[InertiaExcess, ...] = ()
    payload: Payload | None = None
    sloshing_load: SloshingLoad | None = None
    base_tilt: BaseTilt = BaseTilt()
    motor: tuple[Motor, ...] = ()
    rotor_inertia: tuple[RotorInertia, ...] = ()
    elasticity: tuple[Elasticity, ...] = ()
    friction: tuple[Friction, ...] = ()
    shared_transmission: tuple[SharedTransmission, ...] = ()
    joint_spring: tuple[JointSpring, ...] = ()
    counterbalance: tuple[HydraulicCounterbalance, ...] = ()
    cable: tuple[CableHysteresis, ...] = ()
    cogging: tuple[Cogging, ...] = ()
    torque_ripple: tuple[TorqueRipple, ...] = ()
    gear_mesh: tuple[GearMesh, ...] = ()
    wall: tuple[Wall, ...] = ()
    push: tuple[Push, ...] = ()
    angle_sensor: tuple[AngleSensor, ...] = ()
    velocity_sensor: tuple[VelocitySensor, ...] = ()
    torque_sensor: tuple[TorqueSensor, ...] = ()
    wrench_sensor: tuple[WrenchErrors, ...] = ()

    @model_validator(mode="after")
    def _once(self) -> Self:
        for table, key in ONE_EACH.items():
            names = [getattr(entry, key) for entry in getattr(self, table)]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"{table}: {key} {name!r} is there twice; keep one")
        inertias = {r.joint for r in self.rotor_inertia}
        for entry in self.elasticity:
            if entry.joint not in inertias:
                raise ValueError(
                    f"elasticity: joint {entry.joint!r} has no rotor_inertia; an elastic joint is two masses"
                )
        return self


ONE_EACH = {
    "link": "link",
    "link_change": "link",
    "inertia_excess": "link",
    "motor": "joint",
    "rotor_inertia": "joint",
    "elasticity": "joint",
    "friction": "joint",
    "angle_sensor": "joint",
    "velocity_sensor": "joint",
    "torque_sensor": "joint",
    "wrench_sensor": "sensor",
}
"""Tables with at most one entry for each of the named key; of the others a joint or link may have several."""


def load_hidden(installation: Installation, source: Path | str | None = None) -> HiddenMechanics:
    """The hidden mechanics of ``installation`` (nothing, where it names none), or those of ``source``.

    A bare name is a file of this package (``dda`` is ``virtual_hw/hidden/dda.toml``); a path is relative to the
    installation file. Raises InputError for an unknown file, key, joint, link or sensor.
    """
    if source is None:
        if installation.virtual is None:
            raise InputError(
                str(installation.path), "has no [virtual] section, so there is no stand-in for this arm",
                "add a section [virtual]; its key hidden may name mechanics that the URDF does not tell",
            )  # fmt: skip
        source = installation.virtual.hidden
        if source is None:
            return _nothing_hidden(installation)
    path = _path(str(source), installation.path.parent)
    hidden = validate(HiddenMechanics, _read(path), path)
    _check_names(hidden, installation, path)
    return hidden


def _nothing_hidden(installation: Installation) -> HiddenMechanics:
    """The arm as the URDF says. A wrist sensor without any noise would be taken for a frozen one."""
    quiet = [
        WrenchErrors(
            sensor=sensor.name,
            force_noise=Noise(white=SENSOR_NOISE * sensor.range_n),
            torque_noise=Noise(white=SENSOR_NOISE * sensor.range_nm),
        )
        for sensor in installation.wrench_sensor
    ]
    return HiddenMechanics(wrench_sensor=tuple(quiet))


def resolve_hidden(installation: Installation, hidden: HiddenMechanics | Path | str | None) -> HiddenMechanics:
    """Mechanics as they are, or loaded by `load_hidden`."""
    return hidden if isinstance(hidden, HiddenMechanics) else load_hidden(installation, hidden)


def parse_hidden(text: str, installation: Installation, place: str = "hidden mechanics") -> HiddenMechanics:
    """The same from TOML text."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(place, f"is not valid TOML: {error}", "correct the line") from None
    path = Path(place)
    hidden = validate(HiddenMechanics, _extended(data, installation.path.parent, ()), path)
    _check_names(hidden, installation, path)
    return hidden


def _read(path: Path, below: tuple[Path, ...] = ()) -> dict[str, Any]:
    if path in below:
        raise InputError(str(path), "extends itself", "remove one of the extends keys")
    return _extended(read_toml(path), path.parent, (*below, path))


def _extended(data: dict[str, Any], beside: Path, below: tuple[Path, ...]) -> dict[str, Any]:
    source = data.pop("extends", None)
    if source is None:
        return data
    merged = _read(_path(str(source), beside), below)
    for key, value in data.items():
        old = merged.get(key)
        merged[key] = (
            _joined(old, value, ONE_EACH.get(key)) if isinstance(old, list) and isinstance(value, list) else value
        )
    return merged


def _joined(old: list[Any], new: list[Any], identity: str | None) -> list[Any]:
    if identity is None or not all(isinstance(entry, dict) for entry in old + new):
        return old + new
    entries = [dict(entry) for entry in old]
    by_name = {entry.get(identity): entry for entry in entries}
    for entry in new:
        if entry.get(identity) in by_name:
            by_name[entry.get(identity)].update(entry)
        else:
            entries.append(entry)
    return entries


def _path(source: str, beside: Path) -> Path:
    if source.endswith(".toml") or os.sep in source:
        return beside / source
    path = HERE / f"{source}.toml"
    if not path.exists():
        known = ", ".join(sorted(p.stem for p in HERE.glob("*.toml")))
        raise InputError(source, "there are no hidden mechanics of this name", f"known are {known}, or give a path")
    return path


def _check_names(hidden: HiddenMechanics, installation: Installation, path: Path) -> None:
    joints = installation.joint_names
    sensors = tuple(s.name for s in installation.wrench_sensor)
    for table in type(hidden).model_fields:
        entries = getattr(hidden, table)
        if not isinstance(entries, tuple):
            continue
        for number, entry in enumerate(entries):
            for key in ("joint", "joint_other"):
                name = getattr(entry, key, None)
                if name is not None and name not in joints:
                    raise InputError(
                        f"{path}: {table}[{number}].{key}", f"the arm has no joint {name!r}", f"use {', '.join(joints)}"
                    )
            name = getattr(entry, "sensor", None)
            if name is not None and name not in sensors:
                raise InputError(
                    f"{path}: {table}[{number}].sensor",
                    f"the installation has no wrench sensor {name!r}",
                    f"use {', '.join(sensors) or 'an installation that has one'}",
                )
