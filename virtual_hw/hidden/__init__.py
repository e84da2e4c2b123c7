"""The hidden mechanics: laws by which the stand-in arm differs from its URDF, and the files that hold them."""

from virtual_hw.hidden.mechanics import HiddenMechanics, load_hidden, parse_hidden

__all__ = ["HiddenMechanics", "load_hidden", "parse_hidden"]
