"""What SDO writes to PDO parameters are allowed (CiA 301, 7.5.2.35–38), and when."""

from __future__ import annotations

from collections.abc import Callable

from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.pdo import EVENT_DRIVEN, INVALID, SYNCHRONOUS_MAX, Pdo, mapped_entry, mapping_layout

_EXTENDED_ID = 1 << 29
_RESTRICTED = ((0x000, 0x07F), (0x101, 0x180), (0x581, 0x5FF), (0x601, 0x67F), (0x6E0, 0x6FF), (0x701, 0x7FF))
"""Identifiers that no PDO may have (CiA 301, table 37)."""


class PdoRules:
    """Guards the parameters of one PDO and reconfigures it after each change."""

    def __init__(self, pdo: Pdo, pre_operational: Callable[[], bool], changed: Callable[[], None]) -> None:
        """
        Args:
            pre_operational: whether the node may be mapped now.
            changed: called after an accepted write.
        """
        self._pdo, self._pre_operational = pdo, pre_operational
        store = pdo.store
        base = (0x1400 if pdo.receive else 0x1800) + pdo.number
        guards: dict[tuple[int, int], Callable[[int], None]] = {
            (base, 1): self._guard_can_id,
            (base, 2): self._guard_transmission,
            (base, 3): self._guard_inhibit,
            (base + 0x200, 0): self._guard_count,
        }
        for k in range(1, 9):
            guards[base + 0x200, k] = self._guard_mapping
        for key, guard in guards.items():
            if store.has(*key):
                store.guards[key] = guard
                store.effects[key] = lambda _: changed()
        if store.has(base, 5):
            store.effects[base, 5] = lambda _: changed()

    def _guard_can_id(self, value: int) -> None:
        if value & _EXTENDED_ID or value & 0x1FFF_F800:
            raise SdoAbort(Abort.VALUE)
        can_id, becomes_valid = value & 0x7FF, not value & INVALID
        if becomes_valid and any(low <= can_id <= high for low, high in _RESTRICTED):
            raise SdoAbort(Abort.VALUE)
        if self._pdo.valid and becomes_valid and can_id != self._pdo.can_id:
            raise SdoAbort(Abort.DEVICE_STATE)
        if becomes_valid:
            mapping_layout(self._pdo.store, self._pdo.mappings, receive=self._pdo.receive)

    def _guard_transmission(self, value: int) -> None:
        if value > SYNCHRONOUS_MAX and value not in EVENT_DRIVEN:
            raise SdoAbort(Abort.VALUE)

    def _guard_inhibit(self, _value: int) -> None:
        if self._pdo.valid:
            raise SdoAbort(Abort.DEVICE_STATE)

    def _guard_count(self, value: int) -> None:
        self._require_mappable()
        if value > 8:
            raise SdoAbort(Abort.MAPPING_LENGTH)
        values, slots = self._pdo.store.values, self._pdo.mapping_slots
        mapping_layout(self._pdo.store, [values[slot] for slot in slots[1 : 1 + value]], receive=self._pdo.receive)

    def _guard_mapping(self, value: int) -> None:
        self._require_mappable()
        if self._pdo.mappings:
            raise SdoAbort(Abort.DEVICE_STATE)
        if value:
            mapped_entry(self._pdo.store, value, receive=self._pdo.receive)

    def _require_mappable(self) -> None:
        if self._pdo.valid or not self._pre_operational():
            raise SdoAbort(Abort.DEVICE_STATE)
