"""PDO communication and mapping of one drive: written in the order CiA 301 wants, then all of it read back."""

from __future__ import annotations

from collections.abc import Sequence

from driver.cia402.mapping import PdoMap
from driver.cia402.objects import RPDO_COMMUNICATION, TPDO_COMMUNICATION
from driver.cia402.sdo import SdoObjects

INVALID = 0x8000_0000
"""Bit 31 of a PDO's COB-ID: the PDO does not exist."""
_REMOTE_BIT = 0x4000_0000
_COMPARED = ~_REMOTE_BIT & 0xFFFF_FFFF
_COB_ID, _TRANSMISSION, _INHIBIT, _EVENT_TIMER = 1, 2, 3, 5
_SEARCHED = 512
"""CiA 301 allows 512 PDOs each way; those beyond the predefined four can be live from the factory too."""


def remap(sdo: SdoObjects, maps: Sequence[PdoMap], deadline_ms: int) -> None:
    """Give a drive in pre-operational exactly these PDOs; every other PDO of its EDS is disabled.

    ``deadline_ms``: an RPDO that stays away for longer is an error in the drive (event timer of the RPDO).
    Raises InputError for every value that the drive refuses or alters.
    """
    used = {pdo.communication: pdo for pdo in maps}
    communications = [
        base + number
        for base in (RPDO_COMMUNICATION, TPDO_COMMUNICATION)
        for number in range(_SEARCHED)
        if sdo.has(base + number, _COB_ID)
    ]
    for index in used:
        if index not in communications:
            raise sdo.error(f"its EDS has no {used[index].title}", "map the objects into the PDOs that it has")
    for index in communications:
        _disable(sdo, index)
    for pdo in maps:
        _configure(sdo, pdo, deadline_ms)
    for index in communications:
        if index in used:
            _verify(sdo, used[index], deadline_ms)
        else:
            sdo.require(
                index, _COB_ID, INVALID, "an unused PDO could not be disabled; check the firmware", mask=INVALID
            )


def _disable(sdo: SdoObjects, index: int) -> None:
    current = sdo.read(index, _COB_ID)
    if not current & INVALID:
        sdo.write(index, _COB_ID, current | INVALID)


def _timers(sdo: SdoObjects, pdo: PdoMap, deadline_ms: int) -> dict[int, int]:
    """Values of inhibit time and event timer, where the drive has them."""
    wanted = {_EVENT_TIMER: deadline_ms} if pdo.receive else {_INHIBIT: 0, _EVENT_TIMER: 0}
    return {subindex: value for subindex, value in wanted.items() if sdo.has(pdo.communication, subindex)}


def _configure(sdo: SdoObjects, pdo: PdoMap, deadline_ms: int) -> None:
    remote = sdo.read(pdo.communication, _COB_ID) & _REMOTE_BIT  # The drive's own; many refuse to change it.
    invalid = INVALID | remote | pdo.cob_id
    sdo.write(pdo.communication, _COB_ID, invalid)
    sdo.write(pdo.communication, _TRANSMISSION, pdo.transmission)
    for subindex, value in _timers(sdo, pdo, deadline_ms).items():
        sdo.write(pdo.communication, subindex, value)
    sdo.write(pdo.mapping, 0, 0)
    for subindex, entry in enumerate(pdo.entries, 1):
        sdo.write(pdo.mapping, subindex, entry)
    sdo.write(pdo.mapping, 0, len(pdo.entries))
    sdo.write(pdo.communication, _COB_ID, remote | pdo.cob_id)


def _verify(sdo: SdoObjects, pdo: PdoMap, deadline_ms: int) -> None:
    """A silently altered mapping would put every value in the wrong place, so nothing of it is taken on trust."""
    altered = f"the drive altered its {pdo.title}; check its firmware and the drive file"
    sdo.require(pdo.communication, _COB_ID, pdo.cob_id, altered, mask=_COMPARED)
    sdo.require(pdo.communication, _TRANSMISSION, pdo.transmission, altered)
    for subindex, value in _timers(sdo, pdo, deadline_ms).items():
        sdo.require(pdo.communication, subindex, value, altered)
    sdo.require(pdo.mapping, 0, len(pdo.entries), altered)
    for subindex, entry in enumerate(pdo.entries, 1):
        sdo.require(pdo.mapping, subindex, entry, altered)
