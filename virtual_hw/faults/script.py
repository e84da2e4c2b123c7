"""A script of faults: a TOML file with one ``[[fault]]`` table for each, told apart by its ``kind``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from config.section import Section
from config.toml_file import read_toml, validate
from virtual_hw.faults import buses, canopen, drives, frames, sensors

AnyFault = Annotated[
    frames.FrameLost
    | frames.FrameDoubled
    | frames.FrameDelayed
    | frames.FramesSwapped
    | frames.FrameLength
    | buses.CableCut
    | buses.StubCut
    | buses.BitErrors
    | buses.HostBusOff
    | buses.Unplugged
    | buses.InterfaceDown
    | buses.Babbling
    | buses.TwinNode
    | canopen.SdoSilent
    | canopen.SdoAborted
    | canopen.SdoLate
    | canopen.SdoOtherObject
    | canopen.ObjectAltered
    | canopen.SpontaneousBoot
    | canopen.NmtDrop
    | canopen.EmergencyStorm
    | drives.DriveFault
    | drives.SafeTorqueOff
    | drives.ModeRefused
    | drives.AbortOptionSwapped
    | drives.Encoder
    | drives.MotorTorque
    | drives.Brake
    | sensors.WrongCrc
    | sensors.FalseHeader
    | sensors.BytesLost
    | sensors.Stalled
    | sensors.Frozen
    | sensors.StatusBits
    | sensors.Values
    | sensors.ClockJump
    | sensors.WrongBaud
    | sensors.Bursts
    | sensors.SensorGone,
    Field(discriminator="kind"),
]


class FaultScript(Section):
    """What goes wrong, and when."""

    fault: tuple[AnyFault, ...]


def load_faults(path: Path) -> FaultScript:
    """Read a script. Raises InputError naming file, key and remedy."""
    return validate(FaultScript, read_toml(path), path)
