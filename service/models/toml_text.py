"""Values as TOML text."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any


def literal(value: Any) -> str:
    """A TOML literal. JSON's strings, numbers and arrays of them are TOML's, but for floats that are not finite."""
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, list | tuple):
        return "[" + ", ".join(literal(item) for item in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{literal(key)} = {literal(item)}" for key, item in value.items()) + " }"
    return json.dumps(value, ensure_ascii=False)


def keys(values: Mapping[str, Any]) -> list[str]:
    """A line for each key that has a value."""
    return [f"{key} = {literal(value)}" for key, value in values.items() if value is not None]


def block(text: str) -> str:
    """Text of many lines as it is, readable in the file; escaped where it holds what would end it."""
    return literal(text) if "'''" in text or text.endswith("'") else f"'''\n{text}'''"
