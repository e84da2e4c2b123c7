"""The fault matrix: what goes wrong, and what must be seen of it, by whom, within how many cycles.

Faults begin in full swing of a motion of 0.8 rad in 0.7 s, 100 ms after its first hundredth of a radian, unless they
say otherwise. ``within`` counts cycles of 1 ms from the fault's first moment to the cycle in which all axes are being
stopped. A joint that does not obey is seen when it is ``following_error_rad`` away: how soon depends on the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from config.schema import Mode

Outcome = Literal["refused", "stops", "goes on"]
LOST = 5
"""``missed_deadlines_to_stop`` of the arm."""


@dataclass(frozen=True)
class Scenario:
    """One line of the matrix. ``words``: what the sentence to the person must contain; ``resets``: whether the arm
    can be reset afterwards, or switched off and on again where it went on (None: not asked)."""

    family: str
    name: str
    faults: tuple[dict[str, Any], ...]
    outcome: Outcome
    words: str = ""
    within: int = 2
    mode: Mode = "csp"
    resets: bool | None = None


def _one(kind: str, **keys: Any) -> tuple[dict[str, Any], ...]:
    if "delay_ms" not in keys and keys.get("after") is None:
        keys["delay_ms"] = 100.0
    if kind.startswith("wrench"):
        keys.setdefault("sensor", "wrist")
    elif kind in ("cable_cut", "host_bus_off", "unplugged", "babbling"):
        keys.setdefault("bus", "can1")
    else:
        keys.setdefault("joint", "joint2")
    return ({"kind": kind, **keys},)


def _at_start(kind: str, **keys: Any) -> tuple[dict[str, Any], ...]:
    return _one(kind, after="start", **keys)


CAN = [
    Scenario(
        "CAN",
        "one feedback frame lost",
        _one("frame_lost", frame="feedback", only_first=True),
        "goes on",
        "feedback is missing",
    ),
    Scenario(
        "CAN",
        "feedback lost for good",
        _one("frame_lost", frame="feedback"),
        "stops",
        "no feedback",
        LOST + 1,
        resets=False,
    ),
    Scenario(
        "CAN",
        "feedback lost for 20 ms",
        _one("frame_lost", frame="feedback", duration_ms=20),
        "stops",
        "no feedback",
        LOST + 1,
        resets=True,
    ),
    Scenario("CAN", "one command lost", _one("frame_lost", frame="command", only_first=True), "goes on"),
    Scenario("CAN", "commands lost for good", _one("frame_lost", frame="command"), "stops", "8250", 25),
    Scenario("CAN", "every frame doubled", _one("frame_doubled", frame="feedback"), "goes on"),
    Scenario("CAN", "commands doubled", _one("frame_doubled", frame="command"), "goes on"),
    Scenario(
        "CAN",
        "feedback 3 ms late",
        _one("frame_delayed", frame="feedback", by_ms=2.7),
        "stops",
        "no feedback",
        LOST + 3,
    ),
    Scenario("CAN", "commands 2 ms late", _one("frame_delayed", frame="command", by_ms=2), "goes on"),
    Scenario("CAN", "feedback out of order", _one("frames_swapped", frame="feedback"), "goes on"),
    Scenario(
        "CAN", "feedback too short", _one("frame_length", frame="feedback", length=3), "stops", "no feedback", LOST + 1
    ),
    Scenario(
        "CAN", "feedback too long", _one("frame_length", frame="feedback", length=8), "stops", "no feedback", LOST + 1
    ),
    Scenario("CAN", "commands too short", _one("frame_length", frame="command", length=4), "stops", "8210", 3),
    Scenario(
        "CAN",
        "drive's controller bus-off by bit errors",
        _one("bit_errors"),
        "stops",
        "no feedback",
        LOST + 2,
        resets=False,
    ),
    Scenario("CAN", "host's controller warns", _one("host_bus_off", stop_at="warning"), "goes on", "warning"),
    Scenario("CAN", "host's controller error-passive", _one("host_bus_off", stop_at="passive"), "goes on", "passive"),
    Scenario("CAN", "host's controller bus-off", _one("host_bus_off"), "stops", "bus-off", 2),
    Scenario(
        "CAN",
        "host's controller bus-off, restarted",
        _one("host_bus_off", duration_ms=50),
        "stops",
        "bus-off",
        2,
        resets=True,
    ),
    Scenario("CAN", "saturated bus", _one("babbling", can_id=0x7FF), "goes on"),
    Scenario("CAN", "babbling node", _one("babbling", can_id=0x001), "stops", "no feedback", LOST + 1),
    Scenario("CAN", "second node of the same id", _one("twin_node"), "stops", "restarted", 2),
    Scenario("CAN", "cable cut", _one("cable_cut"), "stops", "no feedback", LOST + 1, resets=False),
    Scenario(
        "CAN", "cable cut for 30 ms", _one("cable_cut", duration_ms=30), "stops", "no feedback", LOST + 1, resets=True
    ),
    Scenario("CAN", "cable to one drive cut", _one("stub_cut"), "stops", "no feedback", LOST + 1, resets=False),
    Scenario("CAN", "cable to one drive cut, torque mode", _one("stub_cut"), "stops", "no feedback", LOST + 1, "cst"),
    Scenario("CAN", "interface unplugged", _one("unplugged"), "stops", "left the bus", 2),
]

CANOPEN = [
    Scenario("CANopen", "SDO: no answer", _at_start("sdo_silent"), "refused", "answer"),
    Scenario("CANopen", "SDO: no answer to one object", _at_start("sdo_silent", index=0x6072), "refused", "6072"),
    *(
        Scenario(
            "CANopen", f"SDO: abort {code:08X}", _at_start("sdo_abort", index=0x6072, code=code), "refused", "6072"
        )
        for code in (
            0x05030000,
            0x05040000,
            0x05040001,
            0x06010000,
            0x06010002,
            0x06020000,
            0x06040043,
            0x06060000,
            0x06070010,
            0x06090011,
            0x06090030,
            0x08000000,
            0x08000020,
            0x08000022,
            0xDEADBEEF,
        )
    ),
    Scenario("CANopen", "SDO: answers late", _at_start("sdo_late"), "refused", "joint2"),
    Scenario(
        "CANopen", "SDO: answer of another object", _at_start("sdo_other_object", index=0x6072), "refused", "6072"
    ),
    Scenario(
        "CANopen",
        "another vendor",
        _at_start("object_altered", index=0x1018, subindex=1, value=0x123),
        "refused",
        "1018",
    ),
    Scenario(
        "CANopen", "another product", _at_start("object_altered", index=0x1018, subindex=2, value=7), "refused", "1018"
    ),
    Scenario(
        "CANopen", "another firmware", _at_start("object_altered", index=0x1018, subindex=3, value=2), "refused", "1018"
    ),
    Scenario(
        "CANopen", "another device type", _at_start("object_altered", index=0x1000, value=0x00010192), "refused", "1000"
    ),
    Scenario(
        "CANopen",
        "rated torque of another motor",
        _at_start("object_altered", index=0x6076, value=9000),
        "refused",
        "6076",
    ),
    Scenario(
        "CANopen",
        "a limit that does not stick",
        _at_start("object_altered", index=0x6072, value=60000, sticks=True),
        "refused",
        "6072",
    ),
    Scenario(
        "CANopen",
        "mapping refused",
        _at_start("sdo_abort", index=0x1A00, code=0x06040041, writes_only=True),
        "refused",
        "1A00",
    ),
    Scenario(
        "CANopen",
        "mapping silently altered",
        _at_start("object_altered", index=0x1A00, subindex=2, value=0x60770010, sticks=True),
        "refused",
        "1A00",
    ),
    Scenario(
        "CANopen",
        "extra default PDOs",
        _at_start("object_altered", index=0x1803, subindex=1, value=0x40000482),
        "goes on",
    ),
    Scenario(
        "CANopen",
        "SYNC missing once",
        _one("frame_lost", frame="sync", only_first=True),
        "goes on",
        "feedback is missing",
    ),
    Scenario("CANopen", "SYNC missing", _one("frame_lost", frame="sync"), "stops", "no feedback", LOST + 1),
    Scenario("CANopen", "SYNC late by a whole cycle", _one("frame_delayed", frame="sync", by_ms=1), "goes on"),
    Scenario("CANopen", "SYNC doubled", _one("frame_doubled", frame="sync"), "goes on"),
    Scenario("CANopen", "heartbeat lost", _one("frame_lost", frame="heartbeat"), "stops", "heartbeat", 62),
    Scenario("CANopen", "host's heartbeat lost", _one("frame_lost", frame="host_heartbeat"), "stops", "8130", 64),
    Scenario(
        "CANopen",
        "host's heartbeat lost for 100 ms, torque mode",
        _one("frame_lost", frame="host_heartbeat", duration_ms=100),
        "stops",
        "8130",
        64,
        "cst",
        resets=True,
    ),
    Scenario("CANopen", "spontaneous boot-up", _one("boot_up"), "stops", "restarted", 2, resets=True),
    Scenario("CANopen", "drop to pre-operational", _one("nmt_drop"), "stops", "joint2:", LOST + 1, resets=True),
    Scenario("CANopen", "drop to stopped", _one("nmt_drop", to="stopped"), "stops", "", LOST + 1, resets=True),
    Scenario("CANopen", "emergency storm", _one("emergency_storm", duration_ms=100), "stops", "FF", 2, resets=True),
]

DRIVE = [
    *(
        Scenario("drive", f"fault in {state}", _at_start("drive_fault", code=0x3210, state=state), "refused", "3210")
        for state in ("SWITCH_ON_DISABLED", "READY_TO_SWITCH_ON", "SWITCHED_ON")
    ),
    Scenario(
        "drive",
        "fault in QUICK_STOP_ACTIVE",
        (
            *_one("frame_lost", frame="feedback", duration_ms=20),
            *_at_start("drive_fault", code=0x3210, state="QUICK_STOP_ACTIVE"),
        ),
        "stops",
        "no feedback",
        LOST + 1,
        resets=True,
    ),
    Scenario("drive", "over-voltage in motion", _one("drive_fault", code=0x3210), "stops", "3210", 2, resets=True),
    Scenario(
        "drive",
        "over-voltage in motion, torque mode",
        _one("drive_fault", code=0x3210),
        "stops",
        "3210",
        2,
        "cst",
        resets=True,
    ),
    Scenario("drive", "under-voltage", _one("drive_fault", code=0x3220), "stops", "3220", 2, resets=True),
    Scenario("drive", "over-temperature", _one("drive_fault", code=0x4210), "stops", "4210", 2, resets=True),
    Scenario(
        "drive",
        "over-temperature that stays",
        _one("drive_fault", code=0x4210, resets=False),
        "stops",
        "4210",
        2,
        resets=False,
    ),
    Scenario("drive", "over-current", _one("drive_fault", code=0x2310), "stops", "2310", 2, resets=True),
    Scenario("drive", "resolver fault", _one("drive_fault", code=0x7303), "stops", "7303", 2, resets=True),
    Scenario(
        "drive",
        "heartbeat consumer error, reset only by communication",
        _one("drive_fault", code=0x8130),
        "stops",
        "8130",
        2,
        resets=True,
    ),
    Scenario("drive", "mode refused", _at_start("mode_refused"), "refused", "6060"),
    Scenario("drive", "mode accepted and not taken up", _at_start("mode_refused", silently=True), "refused", "6061"),
    Scenario("drive", "safe torque off", _one("safe_torque_off"), "stops", "left operation", 2),
    Scenario(
        "drive",
        "safe torque off for a moment",
        _one("safe_torque_off", duration_ms=30),
        "stops",
        "left operation",
        2,
        resets=True,
    ),
    *(
        Scenario(
            "drive",
            f"quick stop option {option} does not stick",
            _at_start("object_altered", index=0x605A, value=option, sticks=True),
            "refused",
            "605A",
        )
        for option in (0, 1, 2, 3, 4, 5, 7, 8)
    ),
    Scenario(
        "drive",
        "6007 swapped and commands lost",
        (*_at_start("abort_option_swapped"), *_one("frame_lost", frame="command")),
        "stops",
        "8250",
        25,
    ),
    Scenario("drive", "encoder jumps", _one("encoder", how="jump", rad=0.3), "stops", "jump", 2),
    Scenario("drive", "encoder freezes", _one("encoder", how="freeze"), "stops", "does not change", 250),
    Scenario("drive", "encoder wraps", _one("encoder", how="wrap", bits=11), "stops", "jumped", 300),
    Scenario("drive", "encoder's sign turns", _one("encoder", how="sign"), "stops", "joint2", 120),
    Scenario(
        "drive", "encoder freezes, torque mode", _one("encoder", how="freeze"), "stops", "does not change", 250, "cst"
    ),
    Scenario("drive", "motor phases swapped", _one("motor_torque", factor=-1.0), "stops", "joint2", 120),
    Scenario(
        "drive", "motor phases swapped, torque mode", _one("motor_torque", factor=-1.0), "stops", "joint2", 120, "cst"
    ),
    Scenario("drive", "motor without torque", _one("motor_torque", factor=0.0), "stops", "joint2", 600),
    Scenario("drive", "motor with half its torque", _one("motor_torque", factor=0.5), "goes on"),
    Scenario("drive", "brake stuck", _one("brake", how="stuck"), "stops", "does not change", 250),
]

WRENCH = [
    Scenario("wrench", "wrong CRC", _one("wrench_crc"), "goes on", "no valid sample"),
    Scenario("wrench", "headers inside the payload", _one("wrench_false_header"), "goes on"),
    Scenario("wrench", "bytes lost", _one("wrench_bytes_lost"), "goes on"),
    Scenario("wrench", "bursts of 16 ms", _one("wrench_bursts"), "goes on"),
    Scenario("wrench", "stall", _one("wrench_stall"), "goes on", "no valid sample"),
    Scenario("wrench", "stall and return", _one("wrench_stall", duration_ms=100), "goes on", "valid"),
    Scenario("wrench", "clock wraps", _one("wrench_clock", to_wrap=True), "goes on"),
    Scenario("wrench", "clock jumps", _one("wrench_clock", by_us=5_000_000, duration_ms=50), "goes on"),
    *(
        Scenario("wrench", f"status bit {bit}", _one("wrench_status", bits=1 << bit), "goes on",
                 "" if bit == 0 else "no valid sample")
        for bit in (0, 1, 2, 3, 7)
    ),
    Scenario("wrench", "values frozen, its clock going on", _one("wrench_frozen"), "goes on", "stands still"),
    Scenario("wrench", "values frozen and back", _one("wrench_frozen", duration_ms=50), "goes on", "valid"),
    Scenario("wrench", "saturation", _one("wrench_value", value="saturated"), "goes on", "no valid sample"),
    Scenario("wrench", "NaN", _one("wrench_value", value="nan"), "goes on", "no valid sample"),
    Scenario("wrench", "infinity", _one("wrench_value", value="inf"), "goes on", "no valid sample"),
    Scenario("wrench", "wrong baud rate", _one("wrench_baud"), "goes on", "no valid sample"),
    Scenario("wrench", "unplugged", _one("wrench_gone"), "goes on", "gone", resets=False),
    Scenario("wrench", "unplugged and back", _one("wrench_gone", duration_ms=60), "goes on", "gone", resets=True),
]  # fmt: skip

SCENARIOS = [*CAN, *CANOPEN, *DRIVE, *WRENCH]
