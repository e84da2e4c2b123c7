"""What all typed sections of a configuration file share."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0)]
Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_.-]*$")]
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
