"""PDO codecs: SI through the wire and back, refusal of what cannot be carried, and freshness of feedback."""

from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config import InputError, Installation, load_installation
from config.schema import Drive, Mode, PdoLayout
from driver.bus.frames import Frame, iter_frames, pack
from driver.cia402.mapping import pdo_maps
from driver.cia402.pdo import SYNC, CommandNotRepresentable, PdoCodec, heartbeat

DDA = load_installation("dda")
COUNTS_PER_RAD = 65536 / (2 * math.pi)
angles = st.floats(-30.0, 30.0)
speeds = st.floats(-20.0, 20.0)
permille = st.integers(-32768, 32767)


def three(values: st.SearchStrategy[float]) -> st.SearchStrategy[list[float]]:
    return st.lists(values, min_size=3, max_size=3)


def with_drive(**changes: object) -> Installation:
    name, drive = next(iter(DDA.drives.items()))
    return DDA.model_copy(update={"drives": {name: drive.model_copy(update=changes)}})


def backwards() -> Installation:
    """The second joint's encoder counts backwards from an offset."""
    joint = DDA.joint[1]
    encoder = joint.encoder.model_copy(update={"sign": -1, "zero_rad": 0.75})
    return DDA.model_copy(update={"joint": (DDA.joint[0], joint.model_copy(update={"encoder": encoder}), DDA.joint[2])})


def tpdos(node: int, status: int, counts: int, torque: int, speed: int) -> bytes:
    return pack(0x180 + node, struct.pack("<Hih", status, counts, torque)) + pack(
        0x280 + node, struct.pack("<i", speed)
    )


@given(three(angles), three(speeds), st.lists(permille, min_size=3, max_size=3))
def test_csp_commands_by_the_standards_layout(q: list[float], dq: list[float], raw: list[int]) -> None:
    tau = [value * joint.rated_torque_nm / 1000 for value, joint in zip(raw, DDA.joint, strict=True)]
    blocks = PdoCodec(DDA, "csp").encode([0x0F, 0x06, 0x07], q, dq, tau)
    for i, block in enumerate(blocks):
        first, second = iter_frames(block)
        assert isinstance(first, Frame)
        assert isinstance(second, Frame)
        assert (first.can_id, second.can_id) == (0x201 + i, 0x301 + i)
        word, counts, torque = struct.unpack("<Hih", first.data)
        (speed,) = struct.unpack("<i", second.data)
        assert (word, torque) == ((0x0F, 0x06, 0x07)[i], raw[i])
        assert abs(counts - q[i] * COUNTS_PER_RAD) <= 0.5 + 1e-6
        assert abs(speed - dq[i] * COUNTS_PER_RAD) <= 0.5 + 1e-6


@given(st.lists(permille, min_size=3, max_size=3))
def test_cst_commands_carry_torque_alone(raw: list[int]) -> None:
    tau = [value * joint.rated_torque_nm / 1000 for value, joint in zip(raw, DDA.joint, strict=True)]
    nan = [math.nan] * 3
    for i, block in enumerate(PdoCodec(DDA, "cst").encode([0x0F] * 3, nan, nan, tau)):
        assert bytes(block) == pack(0x201 + i, struct.pack("<Hh", 0x0F, raw[i]))


@given(
    st.sampled_from(("csp", "cst")),
    st.sampled_from(("q", "dq", "tau")),
    st.integers(0, 2),
    st.sampled_from((math.nan, math.inf, -math.inf, 1e12, -1e12)),
)
def test_what_the_wire_cannot_carry_is_refused_by_name(mode: Mode, quantity: str, joint: int, value: float) -> None:
    if mode == "cst" and quantity != "tau":
        return
    codec = PdoCodec(DDA, mode)
    command = {"q": [0.0] * 3, "dq": [0.0] * 3, "tau": [0.0] * 3}
    command[quantity][joint] = value
    what = {"q": "position", "dq": "velocity", "tau": "torque"}[quantity]
    with pytest.raises(CommandNotRepresentable, match=f"joint joint{joint + 1}: a {what}"):
        codec.encode([0x0F] * 3, command["q"], command["dq"], command["tau"])
    assert codec.encode([0x0F] * 3, [0.0] * 3, [0.0] * 3, [0.0] * 3)


def test_saturation_is_refused_at_the_last_count() -> None:
    codec = PdoCodec(DDA, "cst")
    most = 32767 * 66.0 / 1000
    codec.encode([0x0F] * 3, [], [], [most, 0.0, 0.0])
    with pytest.raises(CommandNotRepresentable, match=r"joint joint1: a torque 2162\.69 N·m"):
        codec.encode([0x0F] * 3, [], [], [most + 0.066, 0.0, 0.0])


@pytest.mark.parametrize("word", [-1, 0x10000])
def test_controlwords_are_16_bits(word: int) -> None:
    with pytest.raises(CommandNotRepresentable, match="joint joint2: controlword"):
        PdoCodec(DDA, "cst").encode([0, word, 0], [0.0] * 3, [0.0] * 3, [0.0] * 3)


@given(st.integers(0, 0xFFFF), st.integers(-(2**31), 2**31 - 1), permille, st.integers(-(2**31), 2**31 - 1))
def test_feedback_in_si(status: int, counts: int, torque: int, speed: int) -> None:
    codec = PdoCodec(backwards(), "csp")
    codec.begin_cycle(0)
    packet = tpdos(2, status, counts, torque, speed)
    codec.receive(1, packet, len(packet))
    feedback = codec.feedback()
    assert feedback.valid == [False, True, False]
    assert feedback.statusword == [-1, status, -1]
    assert feedback.q[1] == pytest.approx(0.75 - counts / COUNTS_PER_RAD)
    assert feedback.dq[1] == pytest.approx(-speed / COUNTS_PER_RAD)
    assert feedback.tau[1] == pytest.approx(-torque * 23.0 / 1000)
    assert math.isnan(feedback.q[0])
    assert math.isnan(feedback.tau[2])
    assert codec.raw_value(1, "position") == counts


@given(angles, speeds, st.integers(-32767, 32767))
def test_commands_come_back_as_feedback_of_the_same_sign(q: float, dq: float, raw: int) -> None:
    installation = backwards()
    codec = PdoCodec(installation, "csp")
    tau = raw * 23.0 / 1000
    block = codec.encode([0x0F] * 3, [0.0, q, 0.0], [0.0, dq, 0.0], [0.0, tau, 0.0])[1]
    first, second = iter_frames(block)
    assert isinstance(first, Frame)
    assert isinstance(second, Frame)
    _, counts, torque = struct.unpack("<Hih", first.data)
    (speed,) = struct.unpack("<i", second.data)
    codec.begin_cycle(0)
    packet = tpdos(2, 0x27, counts, torque, speed)
    codec.receive(1, packet, len(packet))
    feedback = codec.feedback()
    assert feedback.q[1] == pytest.approx(q, abs=0.51 / COUNTS_PER_RAD)
    assert feedback.dq[1] == pytest.approx(dq, abs=0.51 / COUNTS_PER_RAD)
    assert feedback.tau[1] == pytest.approx(tau)


def test_nothing_of_the_last_cycle_is_reused() -> None:
    codec = PdoCodec(DDA, "csp")
    codec.begin_cycle(0)
    for node in (1, 2, 3):
        packet = tpdos(node, 0x27, 100, 10, 1)
        codec.receive(node - 1, packet, len(packet))
    assert codec.complete
    assert codec.feedback().valid == [True] * 3
    codec.begin_cycle(1_000_000)
    packet = tpdos(1, 0x27, 100, 10, 1)[:16]  # Half of the joint's feedback.
    codec.receive(0, packet, len(packet))
    feedback = codec.feedback()
    assert feedback.valid == [False] * 3
    assert all(math.isnan(value) for value in feedback.q + feedback.dq + feedback.tau)
    assert not codec.complete


def test_frames_of_others_are_kept_apart() -> None:
    codec = PdoCodec(DDA, "csp")
    codec.begin_cycle(0)
    packet = pack(0x081, bytes(8)) + tpdos(1, 0x27, 0, 0, 0) + pack(0x701, b"\x05") + pack(0x182, bytes(8))
    codec.receive(0, packet, len(packet))
    # Node 2 is on another bus: its identifier means nothing here.
    assert codec.reception.other == [(0, 0x081, bytes(8)), (0, 0x701, b"\x05"), (0, 0x182, bytes(8))]
    assert codec.feedback().valid == [True, False, False]


@pytest.mark.parametrize("length", [0, 1, 7])
def test_a_pdo_of_another_length_is_no_feedback(length: int) -> None:
    codec = PdoCodec(DDA, "csp")
    codec.begin_cycle(0)
    packet = pack(0x181, bytes(length)) + pack(0x281, bytes(4))
    codec.receive(0, packet, len(packet))
    assert codec.feedback().valid[0] is False
    assert codec.reception.malformed == [(0, 0x181, length)]


def test_doubled_feedback_is_counted_and_the_newest_taken() -> None:
    codec = PdoCodec(DDA, "csp")
    codec.begin_cycle(0)
    packet = tpdos(1, 0x27, 100, 0, 0) + tpdos(1, 0x27, 200, 0, 0)
    codec.receive(0, packet, len(packet))
    assert codec.reception.doubled == 2
    assert codec.feedback().q[0] == pytest.approx(200 / COUNTS_PER_RAD)


@given(st.integers(0, 2), st.binary(max_size=400))
def test_random_bytes_on_the_bus_never_crash_the_codec(bus: int, raw: bytes) -> None:
    codec = PdoCodec(DDA, "csp")
    codec.begin_cycle(0)
    codec.receive(bus, raw, len(raw))
    codec.feedback()
    whole = {raw[at : at + 5] for at in range(0, len(raw) - 15, 16)}
    ours = {struct.pack("<IB", 0x181 + bus, 8), struct.pack("<IB", 0x281 + bus, 4)}
    assert codec.feedback().valid[bus] == (ours <= whole)


def encoder_codec() -> PdoCodec:
    layout = DDA.drive_of(DDA.joint[0]).layouts["csp"]
    return PdoCodec(with_drive(layouts={"csp": PdoLayout(rpdo=layout.rpdo, tpdo=layout.tpdo[:1])}), "csp")


def position(counts: int) -> bytes:
    return pack(0x181, struct.pack("<Hih", 0x27, counts, 0))


def test_velocity_from_positions_where_no_pdo_carries_it() -> None:
    codec = encoder_codec()
    seen = []
    for time_ms, counts in ((0, 1000), (1, 1010), (2, None), (4, 1070), (5, 1070)):
        codec.begin_cycle(time_ms * 1_000_000)
        if counts is not None:
            codec.receive(0, position(counts), 16)
        seen.append((codec.feedback().valid[0], codec.feedback().dq[0] * COUNTS_PER_RAD))
    assert [valid for valid, _ in seen] == [False, True, False, True, True]
    # 10 counts in 1 ms; 60 counts in the 3 ms across the gap; standing.
    assert [dq for valid, dq in seen if valid] == pytest.approx([10_000.0, 20_000.0, 0.0])


def test_a_layout_that_commands_both_torques_is_refused() -> None:
    drive = DDA.drive_of(DDA.joint[0])
    layout = PdoLayout(rpdo=(("controlword", "target_torque", "torque_offset"),), tpdo=drive.layouts["cst"].tpdo)
    altered: Drive = drive.model_copy(update={"layouts": {"cst": layout}})
    with pytest.raises(InputError, match="both mapped"):
        pdo_maps(DDA.joint[0], altered, "cst")
    with pytest.raises(InputError, match="has no layout for mode csp"):
        pdo_maps(DDA.joint[0], altered, "csp")


def test_a_layout_that_commands_a_measurement_is_refused() -> None:
    drive = DDA.drive_of(DDA.joint[0])
    layout = PdoLayout(rpdo=(("controlword", "target_torque"), ("velocity",)), tpdo=drive.layouts["cst"].tpdo)
    with pytest.raises(InputError, match="'velocity' is none the loop commands"):
        pdo_maps(DDA.joint[0], drive.model_copy(update={"layouts": {"cst": layout}}), "cst")


def test_mapping_entries_and_identifiers() -> None:
    rpdo1, rpdo2, tpdo1, tpdo2, tpdo4 = pdo_maps(DDA.joint[2], DDA.drive_of(DDA.joint[2]), "csp")
    assert [pdo.cob_id for pdo in (rpdo1, rpdo2, tpdo1, tpdo2)] == [0x203, 0x303, 0x183, 0x283]
    assert rpdo1.entries == (0x60400010, 0x607A0020, 0x60B20010)
    assert (rpdo1.communication, rpdo1.mapping, rpdo2.communication) == (0x1400, 0x1600, 0x1401)
    assert (tpdo1.communication, tpdo1.mapping, tpdo2.mapping) == (0x1800, 0x1A00, 0x1A01)
    assert [pdo.length for pdo in (rpdo1, rpdo2, tpdo1, tpdo2)] == [8, 4, 8, 4]
    assert rpdo1.title == "RPDO1"
    assert (tpdo4.cob_id, tpdo4.communication, tpdo4.entries, tpdo4.length) == (0x483, 0x1803, (0x21100010,), 2)
    assert [pdo.transmission for pdo in (rpdo1, rpdo2, tpdo1, tpdo2, tpdo4)] == [1, 1, 1, 1, 240]


def test_frames_of_the_host() -> None:
    assert pack(0x080) == SYNC
    assert heartbeat(127) == pack(0x77F, b"\x05")
