"""Commissioning against a scripted drive: what it leaves behind, and every way in which a drive is refused."""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable, Iterator
from itertools import count

import can
import pytest

from config import InputError, Installation, load_installation
from config.eds_check import read_eds, variable_at
from config.schema import Joint
from driver.cia402.commission import commission, inspect, interpolation_period, master_node_id
from driver.cia402.states import State

DDA = load_installation("dda")
ONE = DDA.model_copy(
    update={"joint": DDA.joint[:1], "bus": DDA.bus[:1], "arm": DDA.arm.model_copy(update={"home_rad": (0.0,)})}
)
Key = tuple[int, int]
_channels = count()


class ScriptedDrive:
    """A node that keeps what is written, unless it is told to misbehave."""

    def __init__(self, joint: Joint, channel: str) -> None:
        self.node_id = joint.node_id
        self.dictionary = read_eds(DDA.drive_of(joint).eds)
        self.values: dict[Key, int] = {}
        self.written: list[tuple[int, int, int]] = []
        self.alter: dict[Key, Callable[[int], int]] = {}
        """What it keeps instead of what is written."""
        self.silent: set[Key] = set()
        self.boots = self.beats = True
        self.preset(0x6076, 0, round(1000 * joint.rated_torque_nm))
        self.preset(0x6041, 0, 0x0250)
        self._bus = can.Bus(interface="virtual", channel=channel)
        self._notifier = can.Notifier(self._bus, [self._on_message], timeout=0.02)

    def preset(self, index: int, subindex: int, value: int) -> None:
        self.values[index, subindex] = value

    def close(self) -> None:
        self._notifier.stop()
        self._bus.shutdown()

    def send(self, can_id: int, data: bytes) -> None:
        self._bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def _on_message(self, message: can.Message) -> None:
        data = bytes(message.data)
        if message.arbitration_id == 0x000 and data[1] in (0, self.node_id):
            self._nmt(data[0])
        elif message.arbitration_id == 0x600 + self.node_id:
            answer = self._sdo(data)
            if answer is not None:
                self.send(0x580 + self.node_id, answer)

    def _nmt(self, command: int) -> None:
        if command == 0x82 and self.boots:
            self.send(0x700 + self.node_id, b"\x00")
        elif command == 0x01 and self.beats:
            self.send(0x700 + self.node_id, b"\x05")

    def _sdo(self, request: bytes) -> bytes | None:
        command, index, subindex = struct.unpack_from("<BHB", request)
        key = (index, subindex)
        variable = variable_at(self.dictionary, index, subindex)
        if command == 0x80 or key in self.silent:
            return None
        if variable is None:
            return struct.pack("<BHBI", 0x80, index, subindex, 0x06020000)
        size = len(variable) // 8
        if command == 0x40:
            value = self.values.get(key, variable.default or 0)
            return struct.pack("<BHB", 0x43 | (4 - size) << 2, index, subindex) + (value & 0xFFFF_FFFF).to_bytes(
                4, "little"
            )
        value = int.from_bytes(request[4 : 4 + size], "little")
        self.written.append((index, subindex, value))
        self.values[key] = self.alter.get(key, lambda v: v)(value)
        if index == 0x6060:
            self.values.setdefault((0x6061, 0), 0)
            self.values[0x6061, 0] = self.alter.get((0x6061, 0), lambda v: v)(value)
        if index == 0x1017 and self.beats:
            self.send(0x700 + self.node_id, b"\x7f")
        return struct.pack("<BHBI", 0x60, index, subindex, 0)


@pytest.fixture
def drive(monkeypatch: pytest.MonkeyPatch) -> Iterator[ScriptedDrive]:
    channel = f"scripted-{next(_channels)}"
    monkeypatch.setattr(
        "driver.cia402.nodes.python_can_bus", lambda *_, **__: can.Bus(interface="virtual", channel=channel)
    )
    monkeypatch.setattr("driver.cia402.sdo.TIMEOUT_S", 0.1)
    for name in ("BOOT_TIMEOUT_S", "MODE_TIMEOUT_S"):
        monkeypatch.setattr(f"driver.cia402.commission.{name}", 0.2)
    drive = ScriptedDrive(ONE.joint[0], channel)
    yield drive
    drive.close()


def refusal(installation: Installation = ONE) -> str:
    with pytest.raises(InputError) as caught:
        commission(installation, "csp")
    return str(caught.value)


def test_what_commissioning_leaves_behind(drive: ScriptedDrive) -> None:
    said: list[str] = []
    result = commission(ONE, "csp", progress=said.append)
    assert (result.mode, result.master_node) == ("csp", 127)
    (report,) = result.drives
    assert (report.joint, report.state, report.rated_torque_nm) == ("joint1", State.SWITCH_ON_DISABLED, 66.0)
    assert said == [f"joint1: {what}" for what in (
        "reset of the communication", "identity", "configuration for csp", "operational"
    )]  # fmt: skip
    kept = drive.values
    # Two RPDOs and two TPDOs, synchronous, with the deadline of the commands, and the seldom temperature; no others.
    assert [kept[0x1600, k] for k in range(4)] == [3, 0x60400010, 0x607A0020, 0x60B20010]
    assert [kept[0x1601, k] for k in range(2)] == [1, 0x60B10020]
    assert [kept[0x1A00, k] for k in range(4)] == [3, 0x60410010, 0x60640020, 0x60770010]
    assert [kept[0x1400 + k, 1] & 0x8000_07FF for k in range(2)] == [0x201, 0x301]
    assert [kept[0x1800 + k, 1] & 0x8000_07FF for k in range(2)] == [0x181, 0x281]
    assert [kept[0x1A03, k] for k in range(2)] == [1, 0x21100010]
    assert (kept[0x1803, 1] & 0x8000_07FF, kept[0x1803, 2]) == (0x481, 240)
    assert all(kept[index, 1] & 0x8000_0000 for index in (0x1402, 0x1403, 0x1802))
    assert {kept[base + k, 2] for base in (0x1400, 0x1800) for k in (0, 1)} == {1}
    assert (kept[0x1400, 5], kept[0x1401, 5]) == (15, 15)
    # Limits and gains of the joint, options of the drive, 1 ms, heartbeats both ways.
    joint = ONE.joint[0]
    assert kept[0x6072, 0] == round(1000 * joint.limits.torque_nm / joint.rated_torque_nm)
    assert kept[0x2100, 1] == round(1000 * joint.servo.stiffness_nm_rad)
    assert kept[0x2100, 2] == round(1000 * joint.servo.damping_nms_rad)
    counts = [round(q / 6.283185307179586 * joint.encoder.counts_per_turn) for q in joint.limits.position_rad]
    assert [kept[0x607D, 1], kept[0x607D, 2]] == counts
    assert (kept[0x605A, 0], kept[0x605E, 0], kept[0x6007, 0]) == (6, 2, 3)
    assert (kept[0x60C2, 1], kept[0x60C2, 2], kept[0x1006, 0]) == (1, 0xFD, 1000)
    assert (kept[0x1017, 0], kept[0x1016, 1], kept[0x6060, 0]) == (20, 127 << 16 | 60, 8)
    # The controlword is not among what was written.
    assert 0x6040 not in {index for index, _, _ in drive.written}


def test_the_other_mode_maps_anew(drive: ScriptedDrive) -> None:
    commission(ONE, "csp")
    assert commission(ONE, "cst").mode == "cst"
    assert [drive.values[0x1600, k] for k in range(3)] == [2, 0x60400010, 0x60710010]
    assert drive.values[0x1401, 1] & 0x8000_0000
    assert drive.values[0x6061, 0] == 10


def test_offsets_of_the_last_mode_are_gone(drive: ScriptedDrive) -> None:
    drive.preset(0x60B1, 0, 5000)
    drive.preset(0x60B2, 0, 120)
    commission(ONE, "cst")
    assert (drive.values[0x60B1, 0], drive.values[0x60B2, 0]) == (0, 0)


def test_mappings_are_written_in_the_standards_order(drive: ScriptedDrive) -> None:
    commission(ONE, "csp")
    rpdo = [(i, s, v) for i, s, v in drive.written if (i, s) == (0x1400, 1) or i == 0x1600]
    assert rpdo[-7][:2] == (0x1400, 1)
    assert rpdo[-7][2] & 0x8000_0000
    entries = [(0x1600, 1, 0x60400010), (0x1600, 2, 0x607A0020), (0x1600, 3, 0x60B20010)]
    assert rpdo[-6:-1] == [(0x1600, 0, 0), *entries, (0x1600, 0, 3)]
    assert rpdo[-1] == (0x1400, 1, 0x201)


def test_inspection_writes_nothing(drive: ScriptedDrive) -> None:
    (report,) = inspect(ONE)
    assert report.words == "switch on disabled"
    assert drive.written == []


def test_a_fault_is_reported_with_its_error(drive: ScriptedDrive) -> None:
    drive.preset(0x6041, 0, 0x0218)
    drive.preset(0x603F, 0, 0x8611)
    (report,) = commission(ONE, "cst").drives
    assert report.state is State.FAULT
    assert report.words == "fault: following error (8611)"


@pytest.mark.parametrize(
    ("key", "value", "sentence"),
    [
        ((0x1000, 0), 0x00010191, "1000:00 (Device type) is 65937 (0x00010191) instead of 131474"),
        ((0x1018, 1), 0x9A, "is 154 instead of 3709; this is not the drive etude402_tacho"),
        ((0x1018, 2), 0x403, "is 1027 instead of 1026; this is not the drive etude402_tacho"),
        ((0x6502, 0), 0x200, "mode csp is not supported"),
        ((0x6076, 0), 60_000, "is 60 N·m through the gear, the configuration says rated_torque_nm = 66"),
    ],
)
def test_another_device_than_configured(drive: ScriptedDrive, key: Key, value: int, sentence: str) -> None:
    drive.preset(*key, value)
    assert sentence in refusal()
    # Refused before anything was written.
    assert drive.written == []


@pytest.mark.parametrize(
    ("key", "alter", "sentence"),
    [
        ((0x6072, 0), lambda v: 1000, "6072:00 (Max torque) is 1000 instead of 10000"),
        ((0x607D, 2), lambda v: v + 1, "607D:02"),
        ((0x2100, 1), lambda v: v & 0xFFFF, "2100:01 (Servo stiffness)"),
        ((0x605A, 0), lambda v: 2, "605A:00 (Quick stop option code) is 2 instead of 6"),
        ((0x605E, 0), lambda v: 0, "605E:00"),
        ((0x6007, 0), lambda v: 0, "6007:00"),
        ((0x60C2, 1), lambda v: 2, "60C2:01"),
        ((0x1016, 1), lambda v: 0, "1016:01"),
        ((0x1017, 0), lambda v: 0, "1017:00"),
        ((0x1005, 0), lambda v: v | 1 << 30, "1005:00"),
        ((0x6060, 0), lambda v: 0, "6060:00"),
        ((0x6061, 0), lambda v: 1, "does not take up mode csp"),
        ((0x1600, 2), lambda v: 0x60FF0020, "the drive altered its RPDO1"),
        ((0x1600, 0), lambda v: min(v, 2), "the drive altered its RPDO1"),
        ((0x1A00, 3), lambda v: 0x60780010, "the drive altered its TPDO1"),
        ((0x1801, 1), lambda v: v | 0x8000_0000, "the drive altered its TPDO2"),
        ((0x1400, 2), lambda v: 255, "the drive altered its RPDO1"),
        ((0x1401, 5), lambda v: 0, "the drive altered its RPDO2"),
        ((0x1402, 1), lambda v: v & 0x7FFF_FFFF, "an unused PDO could not be disabled"),
    ],
)
def test_a_drive_that_keeps_something_else(
    drive: ScriptedDrive, key: Key, alter: Callable[[int], int], sentence: str
) -> None:
    drive.alter[key] = alter
    problem = refusal()
    assert sentence in problem
    assert problem.startswith("joint joint1 (node 1 on can0): ")


def test_limits_that_nobody_writes_must_be_no_wider_than_the_joints(drive: ScriptedDrive) -> None:
    name, layout = next(iter(ONE.drives.items()))
    start_up = tuple(write for write in layout.start_up if write.index != 0x6080)
    installation = ONE.model_copy(update={"drives": {name: layout.model_copy(update={"start_up": start_up})}})
    assert "6080:00 (Max motor speed) is 4294967295, beyond the joint's " in refusal(installation)


def test_no_boot_up(drive: ScriptedDrive) -> None:
    drive.boots = False
    assert "no boot-up message came within 0.2 s" in refusal()


def test_no_heartbeat(drive: ScriptedDrive) -> None:
    drive.beats = False
    assert "it sends no heartbeat although 1017 is set to 20 ms" in refusal()


def test_an_object_that_is_never_answered(drive: ScriptedDrive) -> None:
    drive.silent.add((0x60C2, 1))
    assert (
        "60C2:01 (Interpolation time period value) could not be written with 1: the drive does not answer" in refusal()
    )


@pytest.mark.parametrize("identifier", [0x080, 0x77F, 0x201, 0x401])
def test_another_host_on_the_bus(drive: ScriptedDrive, identifier: int) -> None:
    done = threading.Event()

    def chatter() -> None:
        while not done.wait(0.005):
            drive.send(identifier, b"\x05" if identifier == 0x77F else b"")

    thread = threading.Thread(target=chatter)
    thread.start()
    try:
        assert f"another host is commanding this bus (it sends 0x{identifier:03X}); stop it first" in refusal()
    finally:
        done.set()
        thread.join()
    assert drive.written == []


@pytest.mark.parametrize(
    ("rate_hz", "expected"),
    [
        (1000, (1, -3)),
        (500, (2, -3)),
        (4000, (25, -5)),
        (2000, (5, -4)),
        (100, (1, -2)),
        (10, (1, -1)),
        (400, (25, -4)),
    ],
)
def test_interpolation_periods(rate_hz: int, expected: tuple[int, int]) -> None:
    value, exponent = interpolation_period(round(1e9 / rate_hz))
    assert (value, exponent) == expected
    assert value * 10**exponent == pytest.approx(1 / rate_hz)


def test_a_period_that_60c2_cannot_say() -> None:
    with pytest.raises(InputError, match="cannot be told to the drives"):
        interpolation_period(round(1e9 / 300))


def test_the_hosts_node_id_is_one_that_no_drive_has() -> None:
    assert master_node_id(ONE) == 127
    joint = ONE.joint[0]
    taken = tuple(joint.model_copy(update={"node_id": n, "name": f"j{n}"}) for n in range(2, 128))
    assert master_node_id(ONE.model_copy(update={"joint": taken})) == 1
    full = (*taken, joint.model_copy(update={"node_id": 1}))
    with pytest.raises(InputError, match="no node id is left"):
        master_node_id(ONE.model_copy(update={"joint": full}))
