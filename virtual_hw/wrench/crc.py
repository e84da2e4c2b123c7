"""The two check sums of the sensors' frames, by table."""

from __future__ import annotations


def _table(polynomial: int) -> tuple[int, ...]:
    rows = []
    for byte in range(256):
        register = byte
        for _ in range(8):
            register = register >> 1 ^ (polynomial if register & 1 else 0)
        rows.append(register)
    return tuple(rows)


_X25 = _table(0x8408)
_MODBUS = _table(0xA001)


def crc_x25(data: bytes) -> int:
    """CRC-16/X-25 (reflected 0x1021, start FFFF, inverted at the end)."""
    register = 0xFFFF
    for byte in data:
        register = register >> 8 ^ _X25[(register ^ byte) & 0xFF]
    return register ^ 0xFFFF


def crc_modbus(data: bytes) -> int:
    """CRC-16/Modbus (reflected 0x8005, start FFFF)."""
    register = 0xFFFF
    for byte in data:
        register = register >> 8 ^ _MODBUS[(register ^ byte) & 0xFF]
    return register
