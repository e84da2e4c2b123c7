"""Emergencies: the error register 1001, the history 1003, and the EMCY message."""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import IntEnum

from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.objects import ObjectStore

_EMCY = struct.Struct("<HB5x")
_HISTORY = 0x1003
_COMMUNICATION = 0x10
"""Bit of the error register."""


class ErrorCode(IntEnum):
    """Emergency error codes (CiA 301, table 26; CiA 402-2) this drive can raise."""

    COMMUNICATION = 0x8100
    HEARTBEAT_LOST = 0x8130
    PDO_TOO_SHORT = 0x8210
    PDO_TOO_LONG = 0x8220
    SYNC_LENGTH = 0x8240
    RPDO_DEADLINE = 0x8250
    FOLLOWING_ERROR = 0x8611
    REFERENCE_LIMIT = 0x8612


def register_bit(code: int) -> int:
    """Bit of the error register that a code sets beside the generic one (CiA 301, 7.5.2.2)."""
    family = code >> 8
    if family in (0x81, 0x82):
        return _COMMUNICATION
    return {0x2: 0x02, 0x3: 0x04, 0x4: 0x08, 0x7: 0x20, 0x8: 0x20, 0xF: 0x80}.get(code >> 12, 0)


class Emergencies:
    """The errors present, oldest first; raising and clearing each sends an EMCY message."""

    def __init__(self, store: ObjectStore, send: Callable[[bytes], None]) -> None:
        """
        Args:
            send: puts eight EMCY bytes on the bus, when the NMT state allows.
        """
        self._values = store.values
        self._send = send
        self._register = store.slot(0x1001)
        self._count = store.slot(_HISTORY, 0)
        self._fields = [store.slot(_HISTORY, k) for k in range(1, 255) if store.has(_HISTORY, k)]
        self._error_code = store.slot(0x603F)
        self._present: list[int] = []
        store.guards[_HISTORY, 0] = self._guard_history
        store.effects[_HISTORY, 0] = lambda _: self._clear_history()

    @property
    def present(self) -> tuple[int, ...]:
        return tuple(self._present)

    def raise_error(self, code: int) -> bool:
        """Announce an error; False when it stood already (an error is told once, however often it recurs)."""
        if code in self._present:
            return False
        self._present.append(code)
        self._update_register()
        values = self._values
        values[self._error_code] = code
        for newer, older in zip(reversed(self._fields[:-1]), reversed(self._fields[1:]), strict=True):
            values[older] = values[newer]
        values[self._fields[0]] = code
        values[self._count] = min(values[self._count] + 1, len(self._fields))
        self._send(_EMCY.pack(code, values[self._register]))
        return True

    def clear(self, *codes: int) -> None:
        """An error's cause is gone; tells `error reset` (code 0000) when no other is left."""
        remaining = [code for code in self._present if code not in codes]
        if remaining == self._present:
            return
        self._present = remaining
        self._update_register()
        self._values[self._error_code] = remaining[-1] if remaining else 0
        if not remaining:
            self._send(_EMCY.pack(0, self._values[self._register]))

    def reset(self, *, communication: bool = False) -> None:
        """Forget all errors, silently, as a reset of the node does, or those of communication alone: a drive that is in
        fault after a reset of its communication still says why."""
        self._present = [code for code in self._present if communication and register_bit(code) != _COMMUNICATION]
        self._update_register()
        self._values[self._error_code] = self._present[-1] if self._present else 0
        self._clear_history()

    def _update_register(self) -> None:
        register = 0
        for code in self._present:
            register |= 0x01 | register_bit(code)
        self._values[self._register] = register

    def _guard_history(self, value: int) -> None:
        if value != 0:
            raise SdoAbort(Abort.VALUE)

    def _clear_history(self) -> None:
        for slot in (self._count, *self._fields):
            self._values[slot] = 0
