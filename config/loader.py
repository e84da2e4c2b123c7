"""Reads an installation: TOML to types, every mistake named with file, key and remedy."""

from __future__ import annotations

import os
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from config.errors import InputError
from config.schema import Drive, Installation

HERE = Path(__file__).parent
T = TypeVar("T", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text())
    except FileNotFoundError:
        raise InputError(str(path), "there is no such file", "check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(path), f"cannot be read ({error})") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(str(path), f"is not valid TOML: {error}") from None


def validate(model: type[T], data: dict[str, Any], path: Path) -> T:
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise InputError(str(path), "; ".join(str(e["msg"]) for e in error.errors())) from None


def installation_path(name_or_path: str) -> Path:
    if name_or_path.endswith(".toml") or os.sep in name_or_path:
        return Path(name_or_path)
    return HERE / "arms" / name_or_path / "installation.toml"


def load_installation(name_or_path: str) -> Installation:
    path = installation_path(name_or_path).absolute()
    data = read_toml(path)
    drives: dict[str, Drive] = {}
    for joint in data.get("joint", []):
        name = joint.get("drive")
        if isinstance(name, str) and name not in drives:
            drives[name] = load_drive(name, path.parent)
    return validate(Installation, {**data, "path": path, "drives": drives}, path)


def load_drive(name: str, beside: Path) -> Drive:
    path = next((p for p in (beside / f"{name}.toml", HERE / "drives" / f"{name}.toml") if p.exists()), None)
    if path is None:
        raise InputError(name, "no such drive")
    data = read_toml(path)
    data["eds"] = path.parent / data["eds"]
    return validate(Drive, data, path)
