"""The hidden mechanics of a stand-in arm: one TOML file that nothing outside `virtual_hw` reads.

A table or an array of tables for each kind of law, by the law's name; the classes beside this file hold their keys.
"""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from config import InputError, Installation
from config.loader import read_toml, validate
from config.schema import Section
from virtual_hw.hidden.bodies import BaseTilt, Link, LinkChange, Payload, SloshingLoad
from virtual_hw.hidden.contact import Push, Wall
from virtual_hw.hidden.friction import Friction
from virtual_hw.hidden.joint_sensors import AngleSensor, TorqueSensor, VelocitySensor
from virtual_hw.hidden.motor import Motor
from virtual_hw.hidden.periodic import Cogging, GearMesh, TorqueRipple
from virtual_hw.hidden.springs import CableHysteresis, HydraulicCounterbalance, JointSpring
from virtual_hw.hidden.transmission import Elasticity, RotorInertia, SharedTransmission
from virtual_hw.hidden.wrench_sensor import WrenchErrors

HERE = Path(__file__).parent


class HiddenMechanics(Section):
    """Everything that makes the stand-in arm another arm than its URDF."""

    description: str = ""
    tick_us: Literal[250, 500, 1000] = 1000
    """The drives' servo tick."""
    substeps: Annotated[int, Field(ge=1, le=20)] = 1
    """Steps of the mechanics in a tick; more for stiff elastic joints."""

    link: tuple[Link, ...] = ()
    link_change: tuple[LinkChange, ...] = ()
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
        for table in ("motor", "rotor_inertia", "elasticity", "friction", *SENSOR_TABLES):
            joints = [entry.joint for entry in getattr(self, table)]
            for joint in joints:
                if joints.count(joint) > 1:
                    raise ValueError(f"{table}: joint {joint!r} is there twice; keep one")
        for key, names in (
            ("link", [b.link for b in self.link]),
            ("link_change", [b.link for b in self.link_change]),
            ("wrench_sensor", [w.sensor for w in self.wrench_sensor]),
        ):
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"{key}: {name!r} is there twice; keep one")
        inertias = {r.joint for r in self.rotor_inertia}
        for entry in self.elasticity:
            if entry.joint not in inertias:
                raise ValueError(
                    f"elasticity: joint {entry.joint!r} has no rotor_inertia; an elastic joint is two masses"
                )
        return self


SENSOR_TABLES = ("angle_sensor", "velocity_sensor", "torque_sensor")


def load_hidden(installation: Installation, source: Path | str | None = None) -> HiddenMechanics:
    """The hidden mechanics of ``installation``, or those of ``source``.

    A bare name is a file of this package (``dda`` is ``virtual_hw/hidden/dda.toml``); a path is relative to the
    installation file. Raises InputError for an unknown file, key, joint, link or sensor.
    """
    if source is None:
        if installation.virtual is None:
            raise InputError(
                str(installation.path), "has no [virtual] section, so there is no stand-in for this arm",
                "add [virtual] with hidden = the name of its mechanics",
            )  # fmt: skip
        source = installation.virtual.hidden
    path = _path(str(source), installation.path.parent)
    hidden = validate(HiddenMechanics, read_toml(path), path)
    _check_names(hidden, installation, path)
    return hidden


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
    hidden = validate(HiddenMechanics, data, path)
    _check_names(hidden, installation, path)
    return hidden


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
