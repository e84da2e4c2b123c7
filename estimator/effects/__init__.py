"""The catalogue: every module of this folder that has an ``EFFECT`` is one effect, found by being there."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from config import InputError
from estimator.effects.effect import Effect, Equation, JointEffect, Law, Parameters, Place
from estimator.effects.lateness import Lateness
from estimator.effects.signals import Scales, Signals

__all__ = [
    "Effect",
    "Equation",
    "JointEffect",
    "Lateness",
    "Law",
    "Parameters",
    "Place",
    "Scales",
    "Signals",
    "catalogue",
    "effect",
]


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by name."""
    modules = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
    effects: list[Effect] = [module.EFFECT for module in modules if hasattr(module, "EFFECT")]
    return {found.name: found for found in effects}


def effect(name: str) -> Effect:
    """The effect of this name. Raises InputError when the catalogue has none."""
    if name not in catalogue():
        raise InputError(f"effect {name!r}", "is not in the catalogue", f"it has {', '.join(sorted(catalogue()))}")
    return catalogue()[name]
