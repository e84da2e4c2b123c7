"""What an installation is: typed configuration, arms, drives, sensors, motions."""

from config.errors import InputError
from config.loader import load_installation
from config.schema import Installation

__all__ = ["InputError", "Installation", "load_installation"]
