"""The stand-in arm's mechanics, behind the drives."""

from __future__ import annotations

from config import Installation
from virtual_hw.hidden.mechanics import HiddenMechanics
from virtual_hw.plant.parts import assemble
from virtual_hw.plant.plant import Plant, WrenchSample

__all__ = ["Plant", "WrenchSample", "build_plant"]


def build_plant(installation: Installation, hidden: HiddenMechanics, seed: int) -> Plant:
    """The plant of ``installation`` with its hidden mechanics (`virtual_hw.hidden.load_hidden`), at rest at home.

    Equal arguments give equal plants, to the last bit. Raises InputError where the three do not fit together.
    """
    return Plant(assemble(installation, hidden), seed)
