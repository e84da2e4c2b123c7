"""SDO abort codes (CiA 301, table 22) that this drive uses."""

from __future__ import annotations

from enum import IntEnum


class Abort(IntEnum):
    TOGGLE = 0x0503_0000
    COMMAND = 0x0504_0001
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    MAPPING_LENGTH = 0x0604_0042
    INCOMPATIBLE = 0x0604_0043
    LENGTH = 0x0607_0010
    TOO_LONG = 0x0607_0012
    TOO_SHORT = 0x0607_0013
    NO_SUBINDEX = 0x0609_0011
    VALUE = 0x0609_0030
    TOO_HIGH = 0x0609_0031
    TOO_LOW = 0x0609_0032
    CANNOT_STORE = 0x0800_0020
    DEVICE_STATE = 0x0800_0022


class SdoAbort(Exception):
    """An access that the drive refuses."""

    def __init__(self, code: Abort) -> None:
        self.code = code
        super().__init__(f"SDO abort {code:#010x} ({code.name})")
