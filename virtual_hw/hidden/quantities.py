"""Number types that the hidden mechanics' parameters share."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

NotNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, lt=1)]
Vector3 = tuple[float, float, float]
