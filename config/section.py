"""What all typed sections of a configuration file share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_.-]*$")]


def _path(value: object, info: ValidationInfo) -> object:
    # JSON has no paths of its own, so that pydantic takes texts there however strictly.
    return Path(value) if isinstance(value, str) and info.mode == "python" else value


FilePath = Annotated[Path, BeforeValidator(_path)]
"""Text in a file; all else is taken strictly, so that "5" is no number."""
Mode = Literal["csp", "cst"]
Quantity = Literal[
    "servo_stiffness",
    "servo_damping",
    "torque_limit",
    "velocity_limit",
    "position_low",
    "position_high",
    "following_error",
]


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
