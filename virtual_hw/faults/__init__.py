"""Faults that the stand-in can be told to have: on its buses, in its drives and its wrench sensors."""

from virtual_hw.faults.injector import Injector
from virtual_hw.faults.script import FaultScript, load_faults

__all__ = ["FaultScript", "Injector", "load_faults"]
