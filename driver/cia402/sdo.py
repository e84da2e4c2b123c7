"""Objects of one drive over SDO: typed by the EDS, read back and compared, every failure one sentence."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable
from typing import TypeVar

import can
import canopen
from canopen.objectdictionary import datatypes

from config.eds_check import raw_range, variable_at
from config.errors import InputError
from config.schema import Joint
from driver.cia402.emergencies import abort_words

TIMEOUT_S = 0.5
ATTEMPTS = 2
T = TypeVar("T")
_INTEGERS = (*datatypes.SIGNED_TYPES, *datatypes.UNSIGNED_TYPES)


class SdoObjects:
    """The object dictionary of one joint's drive.

    All methods raise InputError naming joint, node, object and remedy when the drive does not answer, aborts,
    answers with bytes that are no value of the object, or keeps another value than was written.
    """

    def __init__(self, node: canopen.RemoteNode, joint: Joint) -> None:
        self.joint = joint
        self.place = f"joint {joint.name} (node {joint.node_id} on {joint.bus})"
        self._sdo = node.sdo
        self._sdo.RESPONSE_TIMEOUT = TIMEOUT_S
        self._dictionary = node.object_dictionary
        # It logs every failure, and each becomes a sentence here.
        logging.getLogger("canopen.sdo").setLevel(logging.CRITICAL)

    def has(self, index: int, subindex: int = 0) -> bool:
        """Whether the EDS describes this object."""
        return variable_at(self._dictionary, index, subindex) is not None

    def name(self, index: int, subindex: int = 0) -> str:
        """An object for people: ``6072:00 (Max torque)``."""
        variable = variable_at(self._dictionary, index, subindex)
        return f"{index:04X}:{subindex:02X}" + (f" ({variable.name})" if variable is not None else "")

    def read(self, index: int, subindex: int = 0) -> int:
        """The integer value of an object."""
        signed, size = self._type(index, subindex)
        data, announced = self._attempt(lambda: self._upload(index, subindex), index, subindex, "read")
        if announced is None and len(data) == 4:
            data = data[:size]  # An expedited answer without size carries four bytes, whatever the object.
        if announced is not None and announced != len(data):
            raise self._error(
                index, subindex, f"came with {len(data)} bytes of {announced} announced", "check the wiring"
            )
        if len(data) != size:
            raise self._error(index, subindex, f"came with {len(data)} bytes instead of {size}", "use the drive's EDS")
        return int.from_bytes(data, "little", signed=signed)

    def write(self, index: int, subindex: int, value: int) -> None:
        """Write an object, without reading it back."""
        signed, size = self._type(index, subindex)
        low, high = raw_range(variable_at(self._dictionary, index, subindex))
        if not low <= value <= high:
            raise self._error(
                index, subindex, f"takes {low} to {high}, not {value}", "correct the joint's settings or the drive file"
            )
        data = value.to_bytes(size, "little", signed=signed)
        self._attempt(lambda: self._sdo.download(index, subindex, data), index, subindex, f"written with {value}")

    def write_verified(self, index: int, subindex: int, value: int) -> None:
        """Write an object, read it back and compare."""
        self.write(index, subindex, value)
        self.require(index, subindex, value, "the drive did not keep it; check its firmware and the drive file")

    def require(self, index: int, subindex: int, value: int, remedy: str, *, mask: int = -1) -> int:
        """Read an object and refuse any other value than ``value`` (in the bits of ``mask``); returns what was read."""
        got = self.read(index, subindex)
        if got & mask != value & mask:
            raise self._error(index, subindex, f"is {_shown(got)} instead of {_shown(value)}", remedy)
        return got

    def error(self, problem: str, remedy: str) -> InputError:
        """An error of this drive that concerns no single object."""
        return InputError(self.place, problem, remedy)

    def _type(self, index: int, subindex: int) -> tuple[bool, int]:
        variable = variable_at(self._dictionary, index, subindex)
        if variable is None:
            raise self._error(index, subindex, "is not in the drive's EDS", "use the EDS of this drive")
        if variable.data_type not in _INTEGERS:
            raise self._error(index, subindex, "is no integer in the drive's EDS", "use the EDS of this drive")
        return variable.data_type in datatypes.SIGNED_TYPES, len(variable) // 8

    def _upload(self, index: int, subindex: int) -> tuple[bytes, int | None]:
        """Value bytes and announced size. At most two segments are asked for: no integer is longer."""
        # Not canopen's upload(): it cuts long answers to the object's size without a word.
        stream = self._sdo.open(index, subindex, buffering=0)
        return bytes(stream.read(7)) + bytes(stream.read(7)), stream.size

    def _attempt(self, transfer: Callable[[], T], index: int, subindex: int, what: str) -> T:
        problem = ""
        for _ in range(ATTEMPTS):
            try:
                return transfer()
            except canopen.SdoAbortedError as abort:
                reason = abort_words(abort.code)
                remedy = "check the drive's EDS and firmware"
                raise self._error(index, subindex, f"could not be {what}: {reason}", remedy) from None
            except canopen.SdoCommunicationError as fault:
                problem = "the drive does not answer" if "No SDO response" in str(fault) else f"bad answer: {fault}"
            except struct.error:
                problem = "the answer is cut short"
            except can.CanError as fault:
                raise InputError(self.place, f"the bus failed ({fault})", "check the bus") from None
        remedy = "check supply, wiring, node id and bit rate"
        raise self._error(index, subindex, f"could not be {what}: {problem}", remedy)

    def _error(self, index: int, subindex: int, problem: str, remedy: str) -> InputError:
        return InputError(self.place, f"object {self.name(index, subindex)} {problem}", remedy)


def _shown(value: int) -> str:
    return f"{value}" if abs(value) < 10_000 else f"{value} (0x{value & 0xFFFF_FFFF:08X})"
