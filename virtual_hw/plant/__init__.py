"""The stand-in arm's mechanics, behind the drives."""

from __future__ import annotations

from pathlib import Path

from config import Installation
from virtual_hw.hidden.mechanics import HiddenMechanics, resolve_hidden
from virtual_hw.plant.parts import assemble
from virtual_hw.plant.plant import Plant, WrenchSample

__all__ = ["Plant", "WrenchSample", "build_plant"]


def build_plant(installation: Installation, hidden: HiddenMechanics | Path | str | None, seed: int) -> Plant:
    """The plant of ``installation`` at rest at home, with ``hidden`` mechanics: given, or named as for `load_hidden`.

    Equal arguments give equal plants, to the last bit. Raises InputError where the three do not fit together.
    """
    return Plant(assemble(installation, resolve_hidden(installation, hidden)), seed)
