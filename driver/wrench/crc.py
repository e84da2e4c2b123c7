"""The two 16-bit checksums of the wrench sensors' serial lines. Both are reflected; they differ in polynomial.

The standard library has the un-reflected CCITT sum in C (`binascii.crc_hqx`). Fed with bytes whose bits are
reversed it gives X-25, ten times faster than a table in Python.
"""

from __future__ import annotations

from binascii import crc_hqx

_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def crc16_x25(data: bytes) -> int:
    """CRC-16/X-25: polynomial 0x1021 reflected, start FFFF, inverted; 906E for ``b"123456789"`` (Bota SensONE)."""
    crc = crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return (_REVERSED[crc & 0xFF] << 8 | _REVERSED[crc >> 8]) ^ 0xFFFF


def _modbus_entry(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ (0xA001 if byte & 1 else 0)
    return byte


_MODBUS = tuple(_modbus_entry(byte) for byte in range(256))


def crc16_modbus(data: bytes) -> int:
    """CRC-16/Modbus: polynomial 0x8005 reflected, start FFFF; 4B37 for ``b"123456789"`` (Robotiq FT 300)."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _MODBUS[(crc ^ byte) & 0xFF]
    return crc
