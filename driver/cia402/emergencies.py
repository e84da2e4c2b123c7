"""Emergencies, error registers and SDO abort codes in words for people, with what to do about them."""

from __future__ import annotations

from dataclasses import dataclass

_REGISTER_BITS = (
    (0x01, "generic error"),
    (0x02, "current"),
    (0x04, "voltage"),
    (0x08, "temperature"),
    (0x10, "communication"),
    (0x20, "device profile"),
    (0x80, "manufacturer"),
)

# (words, remedy) by error code; a code whose last digits are zero stands for its whole class (CiA 301, CiA 402).
_CODES: dict[int, tuple[str, str]] = {
    0x0000: ("error reset, no error left", ""),
    0x1000: ("generic error", "read the drive's error history (object 1003)"),
    0x2000: ("current error", "check motor and cabling"),
    0x2220: ("continuous over-current (I²t)", "let the motor cool, lower the load or the torque limit"),
    0x2310: ("continuous over-current", "lower the load or the torque limit; check motor and cabling"),
    0x2320: ("short circuit or earth leakage", "switch off and check the motor's cabling"),
    0x2330: ("earth leakage", "switch off and check the motor's cabling"),
    0x2340: ("short circuit between phases", "switch off and check the motor's cabling"),
    0x3000: ("voltage error", "check the supply"),
    0x3110: ("mains over-voltage", "check the supply"),
    0x3120: ("mains under-voltage", "check the supply"),
    0x3210: ("over-voltage of the DC link", "brake more gently, or fit a brake resistor"),
    0x3220: ("under-voltage of the DC link", "check the supply and the emergency-stop chain"),
    0x4000: ("temperature error", "let it cool"),
    0x4210: ("the drive is too hot", "let it cool, check its ventilation"),
    0x4310: ("the drive is too hot", "let it cool, check its ventilation"),
    0x4410: ("the motor is too hot", "let it cool, lower the load"),
    0x5000: ("hardware fault of the drive", "power-cycle it; have it repaired if it returns"),
    0x5300: ("hardware fault of the drive's operating unit", "power-cycle it; have it repaired if it returns"),
    0x6000: ("software fault of the drive", "power-cycle it"),
    0x6010: ("the drive's watchdog ran out", "power-cycle it"),
    0x6320: ("invalid parameters in the drive", "commission it again"),
    0x7000: ("fault of an additional module", "check what is attached to the drive"),
    0x7110: ("brake fault", "do not rely on the brake; check its supply and wiring"),
    0x7121: ("the motor is blocked", "free the joint"),
    0x7300: ("sensor fault", "check encoder and cable"),
    0x7305: ("encoder fault", "check encoder and cable"),
    0x7310: ("over-speed", "lower the velocity"),
    0x8100: ("communication error", "check the bus"),
    0x8110: ("CAN overrun, frames were lost", "check the bus load"),
    0x8120: ("CAN error passive", "check wiring, termination and bit rate, then reset the communication"),
    0x8130: ("the host's heartbeat was lost", "reset the communication (a fault reset alone is not enough)"),
    0x8140: ("recovered from bus-off", "check wiring, termination and bit rate"),
    0x8150: ("COB-ID collision", "give every node an id of its own"),
    0x8200: ("protocol error", "commission the drive again"),
    0x8210: ("a PDO was too short and was not processed", "commission the drive again"),
    0x8220: ("a PDO was too long", "commission the drive again"),
    0x8240: ("SYNC had an unexpected length", "look for a second master on the bus"),
    0x8250: ("the host's commands stayed away (RPDO deadline)", "look at the loop's lateness, or raise heartbeat_ms"),
    0x8300: ("torque control error", "check the torque limits"),
    0x8400: ("velocity control error", "check the velocity limit"),
    0x8500: ("position control error", "check the position limits"),
    0x8600: ("positioning error", "check the motion against the limits"),
    0x8611: ("following error", "check gains, load, and that nothing blocks the joint"),
    0x8612: ("reference limit: a target beyond the position limits", "check the motion against the limits"),
    0x9000: ("external error", "check the drive's inputs"),
    0xF000: ("additional function failed", "see the drive's manual"),
    0xFF00: ("manufacturer's error", "see the drive's manual"),
}

_ABORTS: dict[int, str] = {
    0x05030000: "toggle bit not alternated",
    0x05040000: "the transfer timed out in the drive",
    0x05040001: "unknown command specifier",
    0x05040002: "invalid block size",
    0x05040003: "invalid sequence number",
    0x05040004: "CRC error",
    0x05040005: "out of memory",
    0x06010000: "unsupported access",
    0x06010001: "the object is write-only",
    0x06010002: "the object is read-only",
    0x06020000: "the drive has no such object",
    0x06040041: "the object cannot be mapped to a PDO",
    0x06040042: "the mapped objects exceed the length of the PDO",
    0x06040043: "the parameter is incompatible",
    0x06040047: "the device is internally incompatible",
    0x06060000: "hardware error",
    0x06070010: "the length does not match the object",
    0x06070012: "the value is too long for the object",
    0x06070013: "the value is too short for the object",
    0x06090011: "the drive has no such sub-index",
    0x06090030: "the value is outside the object's range",
    0x06090031: "the value is too high",
    0x06090032: "the value is too low",
    0x06090036: "the maximum is below the minimum",
    0x060A0023: "the resource is not available (another SDO connection?)",
    0x08000000: "general error",
    0x08000020: "the drive cannot store the value",
    0x08000021: "the drive cannot store the value: local control",
    0x08000022: "the drive's present state forbids it",
    0x08000023: "the object dictionary is missing or faulty",
    0x08000024: "no data available",
}


@dataclass(frozen=True, slots=True)
class Emergency:
    """One EMCY message of a node, decoded."""

    node_id: int
    code: int
    register: int
    vendor: bytes

    @property
    def reset(self) -> bool:
        """Whether it says that an error has gone (code 00xx)."""
        return self.code & 0xFF00 == 0

    @property
    def words(self) -> str:
        return error_code_words(self.code)[0]

    @property
    def remedy(self) -> str:
        return error_code_words(self.code)[1]

    def __str__(self) -> str:
        text = f"{self.words} (EMCY {self.code:04X}, error register {register_words(self.register)}"
        text += f", vendor {self.vendor.hex(' ')})" if any(self.vendor) else ")"
        return text + (f"; {self.remedy}" if self.remedy else "")


def decode_emergency(can_id: int, data: bytes) -> Emergency:
    """The emergency in a frame with identifier 080 + node.

    Raises ValueError when the frame is none: SYNC (080), another identifier, or not 8 bytes.
    """
    node_id = can_id - 0x80
    if not 1 <= node_id <= 127:
        raise ValueError(f"0x{can_id:X} is no identifier of an emergency")
    if len(data) != 8:
        raise ValueError(f"an emergency has 8 bytes, not {len(data)}")
    return Emergency(node_id, int.from_bytes(data[:2], "little"), data[2], bytes(data[3:]))


def error_code_words(code: int) -> tuple[str, str]:
    """(words, remedy) for an error code (EMCY or object 603F): the code itself, else its narrowest known class."""
    if code & 0xFF00 == 0:
        return _CODES[0]
    for mask in (0xFFFF, 0xFFF0, 0xFF00, 0xF000):
        if (found := _CODES.get(code & mask)) is not None and (mask == 0xFFFF or code & mask):
            return found
    return "unknown error", "see the drive's manual"


def register_words(register: int) -> str:
    """The error register (object 1001) in words; "clear" when no bit is set."""
    return ", ".join(text for bit, text in _REGISTER_BITS if register & bit) or (
        f"0x{register:02X}" if register else "clear"
    )


def abort_words(code: int) -> str:
    """An SDO abort code in words, with the code."""
    return f"{_ABORTS.get(code, 'it gave an unknown reason')} (abort {code:08X})"
