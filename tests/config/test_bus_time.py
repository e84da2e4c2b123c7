"""Worst-case bus time: golden frame lengths and loads, and the window in which feedback arrives."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config import InputError, Installation
from config.bus_time import cycle_budget, feedback_window_ns, frame_bits, require_bus_time
from config.schema import Drive, PdoLayout


def on_one_bus(arm: Installation, joints: int, rate_hz: float, rpdo: int, tpdo: int) -> Installation:
    """``joints`` drives on one bus with PDOs of so many bytes."""
    drive = arm.drives["etude402_tacho"]
    sized = {4: ("controlword", "target_torque"), 8: ("controlword", "target_position", "torque_offset")}
    layout = PdoLayout(rpdo=(sized[rpdo],), tpdo=(("statusword", "position", "torque"),) if tpdo == 8 else ())
    packed: Drive = drive.model_copy(update={"layouts": {"csp": layout, "cst": layout}, "temperature": None})
    return arm.model_copy(
        update={
            "bus": arm.bus[:1],
            "cycle": arm.cycle.model_copy(update={"rate_hz": rate_hz}),
            "joint": tuple(
                arm.joint[0].model_copy(update={"name": f"joint{k}", "node_id": k}) for k in range(1, joints + 1)
            ),
            "drives": {"etude402_tacho": packed},
        }
    )


def test_golden_frame_lengths() -> None:
    assert [frame_bits(n) for n in (0, 4, 8)] == [55, 95, 135]
    with pytest.raises(ValueError, match="0 to 8 bytes, not 9"):
        frame_bits(9)


@given(st.binary(max_size=8), st.integers(0, 0x7FF))
def test_no_frame_is_longer_than_its_bound(data: bytes, identifier: int) -> None:
    """Real frames, their CRC included, bit by bit with stuffing; 13 bits after the CRC are never stuffed."""
    bits = f"0{identifier:011b}000{len(data):04b}" + "".join(f"{byte:08b}" for byte in data)
    bits += f"{crc15(bits):015b}"
    stuffed, run, last = 0, 0, ""
    for bit in bits:
        run = run + 1 if bit == last else 1
        last = bit
        if run == 5:
            stuffed, run, last = stuffed + 1, 1, "1" if bit == "0" else "0"
    assert len(bits) + stuffed + 13 <= frame_bits(len(data))


def crc15(bits: str) -> int:
    """CRC of a CAN frame (ISO 11898-1), polynomial 0x4599."""
    crc = 0
    for bit in bits:
        crc = (crc << 1) ^ (0x4599 if (crc >> 14 & 1) != int(bit) else 0)
        crc &= 0x7FFF
    return crc


@pytest.mark.parametrize(
    ("joints", "rate_hz", "rpdo", "percent"),
    [(3, 1000, 8, 86.5), (3, 1000, 4, 74.5), (4, 1000, 4, 97.5), (6, 500, 4, 71.75), (7, 500, 4, 83.25)],
)
def test_golden_loads(dda: Installation, joints: int, rate_hz: float, rpdo: int, percent: float) -> None:
    arm = on_one_bus(dda, joints, rate_hz, rpdo, 8)
    budget = cycle_budget(arm, arm.bus[0], "csp")
    heartbeats = budget.items[-1]
    assert heartbeats.name == "heartbeats"
    assert 100 * (budget.total_us - heartbeats.us_per_cycle) / budget.period_us == pytest.approx(percent)


def test_heartbeats_are_shared_out(dda: Installation) -> None:
    """One frame of 65 bits a node and one of the host, each 20 ms."""
    budget = cycle_budget(dda, dda.bus[0], "csp")
    assert budget.items[-1].us_per_cycle == pytest.approx(2 * 65 / 20)
    assert budget.total_us == pytest.approx(sum(i.us_per_cycle for i in budget.items))


def test_seldom_temperatures_are_shared_out(dda: Installation) -> None:
    """A frame of two bytes a drive, at each 240th SYNC."""
    (item,) = (i for i in cycle_budget(dda, dda.bus[0], "cst").items if i.name == "joint1 TPDO4")
    assert (item.data_bytes, item.us_per_cycle) == (2, pytest.approx(75 / 240))


def test_slower_bits_take_longer(dda: Installation) -> None:
    slow = dda.bus[0].model_copy(update={"bitrate": 500_000})
    assert cycle_budget(dda, slow, "cst").total_us == pytest.approx(2 * cycle_budget(dda, dda.bus[0], "cst").total_us)


def test_too_many_drives_are_refused_with_the_sum(dda: Installation) -> None:
    arm = on_one_bus(dda, 4, 1000, 8, 8)
    with pytest.raises(InputError) as caught:
        require_bus_time(arm, "arm.toml")
    assert str(caught.value) == (
        "arm.toml: bus[0] (can0): the frames of a cycle in mode csp do not fit: SYNC 55"
        " + joint1 RPDO1 135 + joint1 TPDO1 135 + joint2 RPDO1 135 + joint2 TPDO1 135"
        " + joint3 RPDO1 135 + joint3 TPDO1 135 + joint4 RPDO1 135 + joint4 TPDO1 135"
        " + heartbeats 16.25 = 1151 µs of 1000 µs (115 %);"
        " use more buses, cycle.rate_hz of at most 860, or shorter PDOs"
    )


@given(joints=st.integers(4, 20), rpdo=st.sampled_from([4, 8]))
def test_the_rate_in_the_remedy_fits(dda: Installation, joints: int, rpdo: int) -> None:
    arm = on_one_bus(dda, joints, 1000, rpdo, 8)
    try:
        require_bus_time(arm, "arm.toml")
    except InputError as error:
        rate_hz = float(error.remedy.split("at most ")[1].split(",")[0])
        require_bus_time(on_one_bus(dda, joints, rate_hz, rpdo, 8), "arm.toml")
        with pytest.raises(InputError):
            require_bus_time(on_one_bus(dda, joints, rate_hz + 10, rpdo, 8), "arm.toml")


def test_feedback_window_is_that_of_the_fullest_bus(dda: Installation) -> None:
    """One frame under way, SYNC, TPDOs of 8 and 4 bytes, and the drive's answer time."""
    assert feedback_window_ns(dda, "csp") == (135 + 55 + 135 + 95 + 50) * 1000
    crowded = on_one_bus(dda, 3, 1000, 8, 8)
    assert feedback_window_ns(crowded, "csp") == (135 + 55 + 3 * 135 + 50) * 1000
    overfull = on_one_bus(dda, 9, 1000, 8, 8)
    assert feedback_window_ns(overfull, "csp") == 1_000_000
