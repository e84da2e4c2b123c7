"""Reads an installation: TOML to types, then every cross-check that needs no hardware."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from config.bus_time import require_bus_time
from config.eds_check import check_eds
from config.errors import InputError
from config.schema import Drive, Installation
from config.start_up import check_start_up
from config.toml_file import nearest, read_toml, shown, validate
from config.urdf_check import check_urdf

__all__ = ["installation_path", "known_arms", "load_drive", "load_installation", "read_toml", "validate"]

HERE = Path(__file__).parent


def known_arms() -> tuple[str, ...]:
    """Names of the arms that Étude ships."""
    return tuple(sorted(p.parent.name for p in HERE.glob("arms/*/installation.toml")))


def installation_path(name_or_path: str) -> Path:
    """The TOML file of a known arm, or the path itself. Raises InputError for an unknown name."""
    if name_or_path.endswith(".toml") or os.sep in name_or_path:
        path = Path(name_or_path).expanduser().absolute()
        if path.is_file() and path.suffix != ".toml":
            remedy = "give the path of one, ending in .toml (with recordings a URDF will do, ending in .urdf)"
            raise InputError(name_or_path, "is no installation file", remedy)
        return path
    path = HERE / "arms" / name_or_path / "installation.toml"
    if not path.exists():
        raise InputError(
            f"arm {name_or_path!r}",
            f"is not one of {', '.join(known_arms())}",
            "name one of them, or give the path of an installation file ending in .toml",
        )
    return path


def load_installation(name_or_path: str) -> Installation:
    """The installation of a known arm or of a TOML file, complete and consistent.

    Raises InputError naming file, key and remedy: unknown or missing keys, impossible values, joints, limits or
    frames that the URDF has not, a drive unlike its EDS, a cycle that does not fit its bus.
    """
    path = installation_path(name_or_path)
    data = read_toml(path)
    for reserved in ("path", "drives"):
        if reserved in data:
            raise InputError(f"{shown(path)}: {reserved}", "is not a key of this section", "remove it")
    installation = validate(Installation, {**data, "path": path, "drives": _drives(data, path)}, path)
    place = shown(path)
    check_urdf(installation, place)
    check_start_up(installation, place)
    require_bus_time(installation, place)
    return installation


def load_drive(name: str, beside: Path, place: str = "drive") -> Drive:
    """The drive layout ``name``: a file in ``beside``, else one that Étude ships; checked against its EDS."""
    path = next((p for p in (beside / f"{name}.toml", HERE / "drives" / f"{name}.toml") if p.exists()), None)
    if path is None:
        shipped = [p.stem for p in (HERE / "drives").glob("*.toml")]
        raise InputError(place, f"there is no drive {name!r}", nearest(name, shipped))
    data = read_toml(path)
    drive = validate(Drive, data, path)
    drive = drive.model_copy(update={"eds": path.parent / drive.eds})
    check_eds(drive, path)
    return drive


def _drives(data: dict[str, Any], path: Path) -> dict[str, Drive]:
    """Every drive that a joint names; joints without a proper name are left to the types to refuse."""
    drives: dict[str, Drive] = {}
    joints = data.get("joint", [])
    for k, joint in enumerate(joints if isinstance(joints, list) else []):
        name = joint.get("drive") if isinstance(joint, dict) else None
        if isinstance(name, str) and name not in drives:
            drives[name] = load_drive(name, path.parent, f"{shown(path)}: joint[{k}].drive")
    return drives
