"""Task files: what is to be done with a motion, where `etude practise` follows none to the letter (Section 7.2)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from config import InputError, Installation
from config.errors import WrongKey
from config.schema import Name, Positive, Section
from config.toml_file import read_toml, shown, validate

Row = Annotated[tuple[float, ...], Field(min_length=1)]


class HitTask(Section):
    """From rest to rest, and on the way the tool is at ``point_m`` ``at_s`` after the motion's begin."""

    kind: Literal["hit"]
    description: str = ""
    arm: Name | None = None
    start_rad: Row
    end_rad: Row
    point_m: tuple[float, float, float]
    """Of the origin of the installation's tool frame, in the base's frame."""
    at_s: Positive
    duration_s: Positive

    @model_validator(mode="after")
    def _on_the_way(self) -> HitTask:
        if self.at_s >= self.duration_s:
            raise WrongKey("at_s", f"{self.at_s:g} is not before the motion's end", "give less than duration_s")
        return self


class CarryTask(Section):
    """The motion with an unknown payload at the tool: its mass and first moments are the task's parameters."""

    kind: Literal["carry"]
    description: str = ""
    arm: Name | None = None
    motion: str


KINDS: dict[str, type[HitTask | CarryTask]] = {"hit": HitTask, "carry": CarryTask}


def load_task(path: str, installation: Installation) -> HitTask | CarryTask:
    """Raises InputError naming file and key: a wrong file, another arm, rows of a wrong length."""
    file = Path(path)
    data = read_toml(file)
    place, kind = shown(file), data.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        problem = "is missing" if kind is None else f"{kind!r} is no kind of task"
        raise InputError(f"{place}: kind", problem, f"choose one of {', '.join(KINDS)}")
    task = validate(KINDS[kind], data, file)
    if task.arm not in (None, installation.arm.name):
        raise InputError(
            f"{place}: arm", f"it is made for {task.arm}, this arm is {installation.arm.name}", "choose another task"
        )
    if isinstance(task, HitTask):
        names = installation.joint_names
        for key in ("start_rad", "end_rad"):
            if len(row := getattr(task, key)) != len(names):
                raise InputError(
                    f"{place}: {key}", f"has {len(row)} values for {len(names)} joints", f"give {', '.join(names)}"
                )
    return task
