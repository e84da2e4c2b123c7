"""The two check sums of the sensors' frames, by table."""

from __future__ import annotations

from binascii import crc_hqx


def _table(polynomial: int) -> tuple[int, ...]:
    rows = []
    for byte in range(256):
        register = byte
        for _ in range(8):
            register = register >> 1 ^ (polynomial if register & 1 else 0)
        rows.append(register)
    return tuple(rows)


_MIRROR = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_MODBUS = _table(0xA001)


def crc_x25(data: bytes) -> int:
    """CRC-16/X-25 (reflected 0x1021, start FFFF, inverted at the end)."""
    # The same polynomial on mirrored bits is the CCITT sum that the standard library has in C.
    register = crc_hqx(data.translate(_MIRROR), 0xFFFF)
    return (_MIRROR[register & 0xFF] << 8 | _MIRROR[register >> 8]) ^ 0xFFFF


def crc_modbus(data: bytes) -> int:
    """CRC-16/Modbus (reflected 0x8005, start FFFF)."""
    register = 0xFFFF
    for byte in data:
        register = register >> 8 ^ _MODBUS[(register ^ byte) & 0xFF]
    return register
