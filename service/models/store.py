"""Where models live: ``<state>/<arm>/models/0001.toml``, ``0002.toml`` …, never changed and never removed by Étude.

A model is named by its file, by its arm (the newest version), or by ``ARM@VERSION``.
"""

from __future__ import annotations

import os
from pathlib import Path

from config import InputError
from config.paths import state_directory
from service.models.model_file import ModelFile, model_text, read_model
from service.sessions.store import write_once


def model_path(name: str) -> Path:
    """The file that a name means. Raises InputError saying what there is."""
    if name.endswith(".toml") or os.sep in name:
        return Path(name)
    arm, _, version = name.partition("@")
    known = _versions(arm)
    if not known:
        arms = sorted({path.parent.parent.name for path in state_directory().glob("*/models/*.toml")})
        remedy = (
            f"there are models of {', '.join(arms)}"
            if arms
            else "name a model file, such as the links.toml of etude identify links; etude diagnose keeps versions"
        )
        raise InputError(f"model {name}", f"arm {arm} has none", remedy)
    if not version:
        return _path(arm, known[-1])
    if not version.isdecimal() or int(version) not in known:
        raise InputError(f"model {name}", "there is no such version", f"there are {', '.join(map(str, known))}")
    return _path(arm, int(version))


def named_model(name: str) -> ModelFile:
    """The model of a name. Raises InputError when there is none, or its file cannot be read."""
    return read_model(model_path(name))


def next_version(arm: str) -> int:
    """The version that the arm's next model will have."""
    known = _versions(arm)
    return known[-1] + 1 if known else 1


def keep_model(file: ModelFile) -> Path:
    """Keep a model under its arm and version; returns its path. Raises InputError when it cannot be kept."""
    path = _path(file.arm, file.version)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_once(path, model_text(file))
    except FileExistsError:
        raise InputError(str(path), "this version is already there", "try again") from None
    except OSError as error:
        raise InputError(str(path), f"cannot be written ({error.strerror})", "set ETUDE_STATE") from None
    return path


def _path(arm: str, version: int) -> Path:
    return state_directory() / arm / "models" / f"{version:04d}.toml"


def _versions(arm: str) -> list[int]:
    return sorted(int(path.stem) for path in _path(arm, 1).parent.glob("*.toml") if path.stem.isdecimal())
