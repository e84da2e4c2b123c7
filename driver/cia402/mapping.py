"""Which objects travel in which PDO of a drive: from the drive's layout to COB-IDs and mapping entries."""

from __future__ import annotations

from dataclasses import dataclass

from config.drive import TEMPERATURE
from config.errors import InputError
from config.schema import Drive, Joint, Mode

MODE_CODES: dict[Mode, int] = {"csp": 8, "cst": 10}
"""Object 6060 by mode: cyclic synchronous position, cyclic synchronous torque."""
FEEDBACK = ("statusword", "position", "torque")
"""What the TPDOs of every drive carry, by object name; ``velocity`` may be among them."""
COMMANDS = {
    "controlword": "controlword",
    "mode": "mode",
    "target_position": "q",
    "velocity_offset": "dq",
    "target_torque": "tau",
    "torque_offset": "tau",
}
"""The quantity of the loop that each RPDO object carries, by object name."""
_RPDO_IDS = (0x200, 0x300, 0x400, 0x500)
_TPDO_IDS = (0x180, 0x280, 0x380, 0x480)
SYNCHRONOUS = 1
"""Transmission type of all PDOs of a layout: at every SYNC."""


@dataclass(frozen=True, slots=True)
class PdoMap:
    """One PDO in use: ``number`` 1–4, ``receive`` as the drive sees it (RPDO), names and entries in order."""

    receive: bool
    number: int
    cob_id: int
    names: tuple[str, ...]
    entries: tuple[int, ...]
    """Mapping entries ``index << 16 | subindex << 8 | bits``."""
    transmission: int = SYNCHRONOUS
    """Transmission type: at each so-many-th SYNC."""

    @property
    def length(self) -> int:
        """Data bytes."""
        return sum(entry & 0xFF for entry in self.entries) // 8

    @property
    def communication(self) -> int:
        """Index of the communication parameter: 1400+n for RPDOs, 1800+n for TPDOs."""
        return (0x1400 if self.receive else 0x1800) + self.number - 1

    @property
    def mapping(self) -> int:
        """Index of the mapping parameter: 1600+n for RPDOs, 1A00+n for TPDOs."""
        return (0x1600 if self.receive else 0x1A00) + self.number - 1

    @property
    def title(self) -> str:
        return f"{'RPDO' if self.receive else 'TPDO'}{self.number}"


def default_cob_id(receive: bool, number: int, node_id: int) -> int:
    """COB-ID of a PDO in the predefined connection set (CiA 301)."""
    return (_RPDO_IDS if receive else _TPDO_IDS)[number - 1] + node_id


def pdo_maps(joint: Joint, drive: Drive, mode: Mode) -> tuple[PdoMap, ...]:
    """The PDOs that a joint's drive uses in a mode: RPDOs first, each at its predefined COB-ID; last the TPDO of its
    temperature, where it tells one.

    Raises InputError when the layout is missing or commands what the loop has not; that it carries what each mode
    needs is checked with the configuration.
    """
    place = f"drive {drive.name}, layouts.{mode}"
    layout = drive.layouts.get(mode)
    if layout is None:
        raise InputError(f"drive {drive.name}", f"has no layout for mode {mode}", f"add [layouts.{mode}] to its file")
    maps: list[PdoMap] = []
    for receive, pdos in ((True, layout.rpdo), (False, layout.tpdo)):
        for number, names in enumerate(pdos, 1):
            if not names:
                continue
            maps.append(_pdo_map(joint, drive, receive, number, names))
    commanded = [name for pdo in maps if pdo.receive for name in pdo.names]
    for name in commanded:
        if name not in COMMANDS:
            raise InputError(place, f"rpdo object {name!r} is none the loop commands", f"use {', '.join(COMMANDS)}")
    if [COMMANDS[name] for name in commanded].count("tau") > 1:
        raise InputError(place, "target_torque and torque_offset are both mapped", "keep the one of this mode")
    if (warmth := temperature_map(joint, drive)) is not None:
        maps.append(warmth)
    return tuple(maps)


def temperature_map(joint: Joint, drive: Drive) -> PdoMap | None:
    """The TPDO in which a drive tells how warm its motor is; None where it does not."""
    told = drive.temperature
    return None if told is None else _pdo_map(joint, drive, False, told.tpdo, (TEMPERATURE,), told.every)


def _pdo_map(
    joint: Joint, drive: Drive, receive: bool, number: int, names: tuple[str, ...], transmission: int = SYNCHRONOUS
) -> PdoMap:
    entries = tuple(o.index << 16 | o.subindex << 8 | o.bits for o in map(drive.object, names))
    return PdoMap(receive, number, default_cob_id(receive, number, joint.node_id), names, entries, transmission)
