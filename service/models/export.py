"""Models in the formats of others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from config import InputError
from estimator.arm_model import ArmModel
from estimator.export import Kind, left_out, model_mjcf, model_urdf
from service.models.model_file import ModelFile, arm_model, write_model
from service.sessions.store import write_atomically

WRITERS: Mapping[str, tuple[Kind, Callable[[ArmModel], str]]] = {
    ".xml": ("mjcf", model_mjcf),
    ".mjcf": ("mjcf", model_mjcf),
    ".urdf": ("urdf", model_urdf),
}
EXPORTS = frozenset({*WRITERS, ".toml"})
"""File name endings that mean a model's format."""


def export_model(file: ModelFile, output: Path) -> dict[str, Any]:
    """Write a model as the output's ending says; returns where, and ``not_written``, a sentence for each effect that
    the format cannot hold whole. Raises InputError when it cannot be written."""
    if output.suffix == ".toml":
        write_model(output, file)
        return {"output": str(output), "not_written": []}
    kind, text_of = WRITERS[output.suffix]
    model = arm_model(file)
    text = text_of(model)
    try:
        write_atomically(output, text)
    except OSError as error:
        raise InputError(str(output), f"cannot be written ({error.strerror})", "check the directory") from None
    sentences = []
    for left in left_out(model, kind):
        joint = left.effect.place.joint
        where = "the arm" if joint is None else file.joints[joint]
        how = "only in part" if left.partly else f"no element in {kind.upper()}"
        sentences.append(f"{left.effect.name} of {where} ({how})")
    return {"output": str(output), "not_written": sentences}
