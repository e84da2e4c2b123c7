"""What one model has that another has not."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from config import InputError
from estimator.base_parameters import base_parameters
from service.models.model_file import EffectEntry, ModelFile, Parameter, arm_model

SAME = 1e-9
"""Relative difference below which numbers are the same."""


def model_difference(one: ModelFile, other: ModelFile) -> dict[str, Any]:
    """Plain data: ``effects`` added, removed and changed, and ``base_parameters`` that differ, in standard errors
    where there are some. Raises InputError for models of other joints."""
    if one.joints != other.joints:
        raise InputError("models", f"{one.arm} and {other.arm} have other joints", "compare models of one arm")
    before, after = ({_place(entry): entry for entry in file.effect} for file in (one, other))
    return {
        "from": _head(one),
        "to": _head(other),
        "extends": other.parent == one.address,
        "effects": {
            "added": [_described(entry) for place, entry in after.items() if place not in before],
            "removed": [_described(entry) for place, entry in before.items() if place not in after],
            "changed": [c for place in before if place in after for c in _changes(before[place], after[place])],
        },
        "base_parameters": list(_base_changes(one, other)),
    }


def _head(file: ModelFile) -> dict[str, Any]:
    return {"arm": file.arm, "version": file.version, "address": file.address, "status": file.status}


def _place(entry: EffectEntry) -> tuple[str, str | None, str | None, str | None]:
    return entry.name, entry.joint, entry.joint_other, entry.channel


def _described(entry: EffectEntry) -> dict[str, Any]:
    return entry.model_dump(mode="json", exclude_none=True, exclude={"shape"})


def _changes(before: EffectEntry, after: EffectEntry) -> Iterator[dict[str, Any]]:
    for name in dict.fromkeys([*before.parameter, *after.parameter]):
        a, b = before.parameter.get(name), after.parameter.get(name)
        if a is None or b is None or not np.allclose(a.value, b.value, rtol=SAME, atol=0.0):
            yield {
                "effect": after.name,
                "joint": after.joint,
                "parameter": name,
                "before": None if a is None else a.model_dump(mode="json"),
                "after": None if b is None else b.model_dump(mode="json"),
                "standard_errors": None if a is None or b is None else _distance(a, b),
            }


def _distance(a: Parameter, b: Parameter) -> float | None:
    """How far apart two values are, in the standard error of their difference."""
    if a.standard_error is None or b.standard_error is None:
        return None
    error = np.hypot(a.standard_error, b.standard_error)
    if not np.all(error > 0.0):
        return None
    return float(np.max(np.abs(np.subtract(b.value, a.value)) / error))


def _base_changes(one: ModelFile, other: ModelFile) -> Iterator[dict[str, Any]]:
    """Of the base parameters: the others move nothing."""
    first, second = arm_model(one).body, arm_model(other).body
    base = base_parameters(first)
    before, after = base.combination @ first.prior(), base.combination @ second.prior()
    floor = SAME * np.abs(before).max()
    for name, unit, a, b in zip(base.names, base.units, before, after, strict=True):
        if abs(b - a) > max(SAME * abs(a), floor):
            yield {"name": name, "unit": unit, "before": float(a), "after": float(b)}
