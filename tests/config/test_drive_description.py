"""The EDS of the drive, as a stock CANopen library reads it, and the start-up values that joints put into it."""

from __future__ import annotations

import math

import pytest

from config import Installation, load_installation
from config.eds_check import raw_range, read_eds, variable_at
from config.loader import HERE, load_drive
from config.schema import Encoder
from config.start_up import quantity, raw_value

EDS = read_eds(HERE / "drives" / "etude402.eds")
WANTED = """1000 1001 1003 1005 1006 1008 1009 100A 1010 1014 1016 1017 1018 1029 1200
1400 1401 1402 1403 1600 1601 1602 1603 1800 1801 1802 1803 1A00 1A01 1A02 1A03
603F 6040 6041 605A 605B 605C 605D 605E 6007 6060 6061 6064 606C 6065 6066 6071 6072 6075 6076 6077 607A 607D
6080 6084 6085 60B1 60B2 60C2 60FF 6502 2100 2110 2111"""


def test_every_object_of_a_servo_drive_is_there() -> None:
    missing = [name for name in WANTED.split() if int(name, 16) not in EDS]
    assert not missing


def test_records_hold_as_many_entries_as_they_say() -> None:
    for entry in EDS.values():
        if hasattr(entry, "subindices") and entry.index not in range(0x1600, 0x1604):
            highest = max(entry.subindices)
            counts_errors_or_mappings = entry.index == 0x1003 or entry.index in range(0x1A00, 0x1A04)
            assert counts_errors_or_mappings or entry[0].default == highest, f"{entry.index:04X}"


@pytest.mark.parametrize("base", [0x1600, 0x1A00])
def test_default_mappings_name_objects_that_can_be_mapped(base: int) -> None:
    for number in range(4):
        record = EDS[base + number]
        assert 1 <= record[0].default <= 8
        for k in range(1, record[0].default + 1):
            index, sub, bits = record[k].default >> 16, record[k].default >> 8 & 0xFF, record[k].default & 0xFF
            mapped = variable_at(EDS, index, sub)
            assert mapped.pdo_mappable and len(mapped) == bits, f"{record[k].default:08X}"


def test_identifiers_follow_the_node() -> None:
    import canopen

    node7 = canopen.import_od(str(HERE / "drives" / "etude402.eds"), 7)
    assert [node7[0x1400 + k][1].default for k in range(4)] == [0x207, 0x307, 0x407, 0x507]
    assert [node7[0x1800 + k][1].default & 0x7FF for k in range(4)] == [0x187, 0x287, 0x387, 0x487]
    assert node7[0x1014].default == 0x87
    assert node7[0x6502].default == 0b11_1000_0000, "CSP, CSV and CST"


def test_signed_limits_are_read_as_signed() -> None:
    assert raw_range(EDS[0x607D][1]) == (-(2**31), 2**31 - 1)
    assert raw_range(EDS[0x6007]) == (0, 3)
    assert raw_range(EDS[0x6072]) == (0, 10000)
    assert variable_at(EDS, 0x607D, 9) is None
    assert variable_at(EDS, 0x6040, 1) is None
    assert variable_at(EDS, 0x5FFF, 0) is None


def test_start_up_values_of_the_direct_drive_arm(dda: Installation) -> None:
    joint = dda.joint[0]
    by_key = {w.from_key: raw_value(joint, w) for w in dda.drive_of(joint).start_up}
    assert by_key["servo_stiffness"] == round(1000 * joint.servo.stiffness_nm_rad)
    assert by_key["torque_limit"] == 10_000
    assert by_key["velocity_limit"] == round(10.0 * 65536 / (2 * math.pi))
    assert by_key["position_low"] == round(0.2 * 65536 / (2 * math.pi))


def test_an_encoder_that_counts_backwards_swaps_its_limits(dda: Installation) -> None:
    backwards = dda.joint[0].model_copy(update={"encoder": Encoder(counts_per_turn=1000, sign=-1, zero_rad=1.0)})
    low, high = quantity(backwards, "position_low"), quantity(backwards, "position_high")
    assert low == pytest.approx(-(6.1 - 1.0) * 1000 / (2 * math.pi))
    assert high == pytest.approx(-(0.2 - 1.0) * 1000 / (2 * math.pi))
    assert quantity(backwards, "velocity_limit") > 0


def test_the_encoder_drive_measures_no_velocity() -> None:
    drive = load_drive("etude402_encoder", HERE)
    mapped = {name for layout in drive.layouts.values() for pdo in (*layout.rpdo, *layout.tpdo) for name in pdo}
    assert not mapped & {"velocity", "velocity_offset"}
    assert {"velocity", "velocity_offset"} <= {
        o.name for o in load_installation("dda").drives["etude402_tacho"].objects
    }
