"""PDOs: the rules of mapping them, and when they act."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from virtual_hw.drive.aborts import Abort
from virtual_hw.drive.emergency import ErrorCode
from virtual_hw.drive.states import PowerState

INVALID = 1 << 31


@pytest.fixture
def mapped(bench: Any) -> Any:
    """Torque mode, operational: RPDO 1 controlword and torque, TPDO 1 statusword, position, torque."""
    bench.commission(10)
    return bench


def command(controlword: int, torque: int = 0) -> bytes:
    return struct.pack("<Hh", controlword, torque)


def test_a_mapping_is_read_back_as_written(mapped: Any) -> None:
    assert mapped.read(0x1600, 0) == 2
    assert mapped.read(0x1600, 2) == 0x60710010
    assert mapped.read(0x1400, 1) == 0x201


def test_a_valid_pdo_cannot_be_mapped(bench: Any) -> None:
    assert bench.write(0x1600, 0, 0, 1) == Abort.DEVICE_STATE
    assert bench.write(0x1600, 1, 0x60400010, 4) == Abort.DEVICE_STATE


def test_mapped_objects_cannot_be_changed_before_their_number_is_zero(bench: Any) -> None:
    bench.write(0x1400, 1, INVALID | 0x201, 4)
    assert bench.write(0x1600, 1, 0x60710010, 4) == Abort.DEVICE_STATE
    assert bench.write(0x1600, 0, 0, 1) == 0
    assert bench.write(0x1600, 1, 0x60710010, 4) == 0


def test_mapping_is_for_pre_operational_only(mapped: Any) -> None:
    mapped.write(0x1400, 1, INVALID | 0x201, 4)
    assert mapped.write(0x1600, 0, 0, 1) == Abort.DEVICE_STATE


@pytest.mark.parametrize(
    ("base", "mapping", "code"),
    [
        (0x1400, 0x60410010, Abort.NOT_MAPPABLE),  # read-only into an RPDO
        (0x1400, 0x60400020, Abort.NOT_MAPPABLE),  # wrong length
        (0x1400, 0x5FFF0010, Abort.NOT_MAPPABLE),  # no such object
        (0x1800, 0x60850020, Abort.NOT_MAPPABLE),  # not mappable by the EDS
        (0x1800, 0x607A0020, Abort.NOT_MAPPABLE),  # a command into a TPDO
    ],
)
def test_unmappable_objects(bench: Any, base: int, mapping: int, code: Abort) -> None:
    bench.write(base, 1, INVALID | bench.read(base, 1), 4)
    assert bench.write(base + 0x200, 0, 0, 1) == 0
    assert bench.write(base + 0x200, 1, mapping, 4) == code


def test_more_than_eight_bytes_are_refused(bench: Any) -> None:
    bench.write(0x1800, 1, INVALID | 0x181, 4)
    bench.write(0x1A00, 0, 0, 1)
    for k, mapping in enumerate((0x60640020, 0x606C0020, 0x60410010), 1):
        assert bench.write(0x1A00, k, mapping, 4) == 0
    assert bench.write(0x1A00, 0, 3, 1) == Abort.MAPPING_LENGTH
    assert bench.write(0x1A00, 0, 2, 1) == 0


def test_dummies_leave_bytes_to_others(bench: Any) -> None:
    bench.disable_pdos()
    bench.map_pdo(0x1400, [0x00060010, 0x60400010], transmission=255)
    bench.nmt(0x01)
    bench.send(0x201, struct.pack("<HH", 0xFFFF, 0x0006))
    bench.run(1)
    assert bench.read(0x6040) == 6


def test_cob_id_rules(bench: Any) -> None:
    assert bench.write(0x1400, 1, 0x301, 4) == Abort.DEVICE_STATE
    assert bench.write(0x1400, 1, INVALID | 0x301, 4) == 0
    assert bench.write(0x1400, 1, 0x2000_0301, 4) == Abort.VALUE
    assert bench.write(0x1400, 1, 0x601, 4) == Abort.VALUE
    assert bench.write(0x1400, 1, 0x321, 4) == 0
    assert bench.read(0x1400, 1) == 0x321


@pytest.mark.parametrize(("kind", "code"), [(0, 0), (240, 0), (241, Abort.VALUE), (252, Abort.VALUE), (254, 0)])
def test_transmission_types(bench: Any, kind: int, code: int) -> None:
    assert bench.write(0x1800, 2, kind, 1) == code


def test_the_inhibit_time_of_a_valid_pdo_is_fixed(bench: Any) -> None:
    assert bench.write(0x1800, 3, 10, 2) == Abort.DEVICE_STATE
    bench.write(0x1800, 1, INVALID | 0x181, 4)
    assert bench.write(0x1800, 3, 10, 2) == 0


def test_a_synchronous_command_acts_at_the_sync_and_is_answered_one_later(mapped: Any) -> None:
    mapped.send(0x201, command(0x06))
    mapped.run(5)
    assert mapped.state is PowerState.SWITCH_ON_DISABLED
    first, second = mapped.cycle(), mapped.cycle()
    assert first is not None and second is not None
    assert first[0] & 0x6F == 0x40
    assert second[0] & 0x6F == 0x21


def test_the_newest_rpdo_before_the_sync_counts(mapped: Any) -> None:
    mapped.send(0x201, command(0x06, 1))
    mapped.run(0.3)
    mapped.cycle(command(0x06, 2))
    assert mapped.read(0x6071) == 2


def test_an_sdo_write_to_a_mapped_object_is_overwritten_by_the_next_rpdo(mapped: Any) -> None:
    mapped.cycle(command(0x06))
    mapped.write(0x6040, 0, 0x07, 2)
    mapped.cycle(command(0x06))
    assert mapped.read(0x6040) == 0x06
    assert mapped.state is PowerState.READY_TO_SWITCH_ON


def test_tpdo_values_are_those_of_the_arm(mapped: Any) -> None:
    answer = mapped.cycle(command(0))
    statusword, position, torque = struct.unpack("<Hih", answer)
    assert statusword & 0x4F == 0x40
    assert position == mapped.arm.counts(0)
    assert torque == 0


def test_every_second_sync(bench: Any) -> None:
    bench.disable_pdos()
    bench.map_pdo(0x1800, [0x60410010], transmission=2)
    bench.nmt(0x01)
    assert [bench.cycle() is not None for _ in range(6)] == [False, True, False, True, False, True]


def test_acyclic_synchronous_tpdo_tells_changes_only(bench: Any) -> None:
    bench.disable_pdos()
    bench.map_pdo(0x1800, [0x60410010], transmission=0)
    bench.nmt(0x01)
    answers = [bench.cycle() is not None for _ in range(3)]
    bench.controlword(0x06)
    answers += [bench.cycle() is not None for _ in range(2)]
    assert answers == [True, False, False, True, False]


def test_event_driven_tpdo_with_timer_and_inhibit(bench: Any) -> None:
    bench.disable_pdos()
    bench.write(0x1800, 3, 30, 2)  # 3 ms
    bench.map_pdo(0x1800, [0x60410010], transmission=255, timer_ms=10)
    bench.nmt(0x01)
    bench.heard.clear()
    bench.run(31)
    assert len(bench.frames(0x181)) == 4
    bench.heard.clear()
    bench.controlword(0x06, 0x07, 0x06, 0x07)
    words = [data[0] & 0x6F for data in bench.frames(0x181)]
    assert len(words) <= 1
    bench.run(3)
    assert bench.frames(0x181)[-1][0] & 0x6F == 0x23


def test_no_pdos_but_in_operational(mapped: Any) -> None:
    assert mapped.cycle(command(0x06)) is not None
    for nmt in (0x80, 0x02):
        mapped.nmt(nmt)
        assert mapped.cycle(command(0x07)) is None
    assert mapped.state is PowerState.READY_TO_SWITCH_ON
    mapped.nmt(0x01)
    assert mapped.cycle(command(0x07)) is not None


def test_default_rpdos_let_a_stranger_command_the_axis(bench: Any) -> None:
    bench.nmt(0x01)
    bench.send(0x401, b"\x06\x00" + bytes(6))
    bench.run(1)
    assert bench.state is PowerState.READY_TO_SWITCH_ON


def test_a_disabled_pdo_is_deaf(bench: Any) -> None:
    bench.disable_pdos()
    bench.nmt(0x01)
    bench.send(0x401, b"\x06\x00" + bytes(6))
    bench.run(1)
    assert bench.state is PowerState.SWITCH_ON_DISABLED


def test_a_short_rpdo_is_ignored_and_told_once(mapped: Any) -> None:
    mapped.heard.clear()
    for _ in range(3):
        mapped.send(0x201, b"\x06")
        mapped.send(0x080)
        mapped.run(1)
    assert mapped.emergencies() == [ErrorCode.PDO_TOO_SHORT]
    assert mapped.state is PowerState.SWITCH_ON_DISABLED
    assert mapped.read(0x1001) == 0x11
    mapped.cycle(command(0x06))
    assert mapped.emergencies() == [0x0000]
    assert mapped.read(0x1001) == 0


def test_a_long_rpdo_is_used_and_told(mapped: Any) -> None:
    mapped.cycle(command(0x06) + b"\xff")
    assert mapped.emergencies() == [ErrorCode.PDO_TOO_LONG]
    assert mapped.state is PowerState.READY_TO_SWITCH_ON


def test_a_sync_with_data_is_told(mapped: Any) -> None:
    mapped.heard.clear()
    mapped.send(0x080, b"\1")
    mapped.run(1)
    assert mapped.emergencies() == [ErrorCode.SYNC_LENGTH]
    assert mapped.frames(0x181) == []
