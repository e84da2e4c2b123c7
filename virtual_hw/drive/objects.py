"""The live object dictionary of a drive: what the EDS declares, with a value behind each object."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import canopen
from canopen.objectdictionary import ODArray, ODRecord, ODVariable

from config import InputError
from virtual_hw.drive.aborts import Abort, SdoAbort

_FORMATS = {0x1: "?", 0x2: "b", 0x3: "h", 0x4: "i", 0x5: "B", 0x6: "H", 0x7: "I", 0x15: "q", 0x1B: "Q"}
_TEXT = (0x9, 0xA)


@dataclass(frozen=True, slots=True)
class Entry:
    """One object or sub-object as the EDS declares it."""

    index: int
    subindex: int
    name: str
    format: str
    """`struct` format character of a number; empty for text."""
    text: bytes
    slot: int
    """Where the number lives in `ObjectStore.values`; -1 for text."""
    default: int
    low: int
    high: int
    readable: bool
    writable: bool
    into_tpdo: bool
    into_rpdo: bool

    @property
    def size(self) -> int:
        """Bytes on the wire."""
        return struct.calcsize(self.format) if self.format else len(self.text)


class ObjectStore:
    """Values by slot, so that PDOs and the servo reach them without a look-up; SDO reaches them by index.

    Numbers are the raw integers of the objects. `values[slot]` may be written past all checks by the drive itself.
    """

    def __init__(self, eds: Path, node_id: int) -> None:
        """
        Raises:
            InputError: the EDS cannot be parsed, or an object has a type this drive cannot keep.
        """
        self._entries: dict[tuple[int, int], Entry] = {}
        self._indices: set[int] = set()
        self.values: list[int] = []
        self.guards: dict[tuple[int, int], Callable[[int], None]] = {}
        """Called before an SDO write with the new value; raises SdoAbort to refuse it."""
        self.effects: dict[tuple[int, int], Callable[[int], None]] = {}
        """Called after an SDO write with the new value."""
        self.sources: dict[tuple[int, int], Callable[[], int]] = {}
        """Objects whose value is measured when it is read."""
        try:
            dictionary = canopen.import_od(str(eds), node_id)
        except Exception as error:  # canopen raises whatever its parser stumbles on
            raise InputError(str(eds), f"is not a valid EDS ({error})", "correct the file") from None
        for item in dictionary.values():
            self._indices.add(item.index)
            for variable in item.values() if isinstance(item, ODRecord | ODArray) else (item,):
                self._declare(variable, eds)
        self._power_on = list(self.values)

    def slot(self, index: int, subindex: int = 0) -> int:
        """Slot of a number that the drive's firmware relies on.

        Raises:
            InputError: the EDS has no such object.
        """
        entry = self._entries.get((index, subindex))
        if entry is None or entry.slot < 0:
            raise InputError(f"object {index:04X}:{subindex}", "is not in the EDS", "a CiA 402 drive needs it; add it")
        return entry.slot

    def has(self, index: int, subindex: int = 0) -> bool:
        return (index, subindex) in self._entries

    def entry(self, index: int, subindex: int) -> Entry:
        """
        Raises:
            SdoAbort: no such object, no such sub-index.
        """
        entry = self._entries.get((index, subindex))
        if entry is None:
            raise SdoAbort(Abort.NO_SUBINDEX if index in self._indices else Abort.NO_OBJECT)
        return entry

    def read(self, index: int, subindex: int) -> bytes:
        """What an SDO upload carries.

        Raises:
            SdoAbort: no such object or sub-index, write-only.
        """
        entry = self.entry(index, subindex)
        if not entry.readable:
            raise SdoAbort(Abort.WRITE_ONLY)
        if not entry.format:
            return entry.text
        source = self.sources.get((index, subindex))
        if source is not None:
            self.values[entry.slot] = source()
        return struct.pack("<" + entry.format, self.values[entry.slot])

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """What an SDO download does.

        Raises:
            SdoAbort: no such object or sub-index, read-only, wrong length, out of the limits of the EDS, or
                refused by the drive in its present state.
        """
        entry = self.entry(index, subindex)
        if not entry.writable or not entry.format:
            raise SdoAbort(Abort.READ_ONLY)
        if len(data) != entry.size:
            raise SdoAbort(Abort.TOO_LONG if len(data) > entry.size else Abort.TOO_SHORT)
        (value,) = struct.unpack("<" + entry.format, data)
        if value > entry.high:
            raise SdoAbort(Abort.TOO_HIGH)
        if value < entry.low:
            raise SdoAbort(Abort.TOO_LOW)
        guard = self.guards.get((index, subindex))
        if guard is not None:
            guard(value)
        self.values[entry.slot] = value
        effect = self.effects.get((index, subindex))
        if effect is not None:
            effect(value)

    def reset(self, low: int = 0, high: int = 0xFFFF) -> None:
        """Give every writable object with an index of ``low`` to ``high`` its power-on value."""
        for (index, _), entry in self._entries.items():
            if low <= index <= high and entry.writable and entry.slot >= 0:
                self.values[entry.slot] = self._power_on[entry.slot]

    def preset(self, index: int, subindex: int, value: int) -> None:
        """What this unit left the factory with, where that is not the EDS' default."""
        slot = self.slot(index, subindex)
        self.values[slot] = self._power_on[slot] = value

    def save(self) -> None:
        """Make the present values the power-on values of all writable objects (object 1010)."""
        for entry in self._entries.values():
            if entry.writable and entry.slot >= 0:
                self._power_on[entry.slot] = self.values[entry.slot]

    def _declare(self, variable: ODVariable, eds: Path) -> None:
        place = f"{eds}: object {variable.index:04X}:{variable.subindex}"
        access = str(variable.access_type).lower()
        numeric = variable.data_type in _FORMATS
        if not numeric and variable.data_type not in _TEXT:
            raise InputError(place, f"has the data type {variable.data_type:#06x}", "use an integer or a string")
        code = _FORMATS[variable.data_type] if numeric else ""
        default = variable.default
        text = b"" if numeric else (default if isinstance(default, bytes) else str(default or "").encode())
        low, high = _natural_range(code)
        mappable = bool(variable.pdo_mappable)
        self._entries[variable.index, variable.subindex] = Entry(
            index=variable.index,
            subindex=variable.subindex,
            name=variable.name,
            format=code,
            text=text,
            slot=len(self.values) if numeric else -1,
            default=int(default or 0) if numeric else 0,
            low=low if variable.min is None else int(variable.min),
            high=high if variable.max is None else int(variable.max),
            readable=access != "wo",
            writable=access not in ("ro", "const"),
            into_tpdo=mappable and access in ("ro", "rw", "rwr", "const"),
            into_rpdo=mappable and access in ("wo", "rw", "rww"),
        )
        if numeric:
            self.values.append(int(default or 0))


def _natural_range(code: str) -> tuple[int, int]:
    if not code:
        return 0, 0
    bits = 8 * struct.calcsize(code)
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if code.islower() else (0, (1 << bits) - 1)
