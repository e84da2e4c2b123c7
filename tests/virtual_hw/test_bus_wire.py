"""The bus: who sends when, what it takes, what is lost."""

from __future__ import annotations

import pytest

from virtual_hw.bus.frames import frame, frame_bits
from virtual_hw.bus.wire import Bus, Controller

BIT_NS = 1000


class Ear:
    def __init__(self, bus: Bus, depth: int = 8) -> None:
        self.heard: list[tuple[int, int]] = []
        self.controller = Controller(depth, lambda t, raw: self.heard.append((t, int.from_bytes(raw[:4], "little"))))
        bus.attach(self.controller)


@pytest.fixture
def bus() -> Bus:
    return Bus("can0", 1_000_000, 0)


def test_lowest_identifier_of_all_queues_wins_and_equal_ones_keep_their_order(bus: Bus) -> None:
    a, b, listener = Ear(bus), Ear(bus), Ear(bus)
    bus.send(a.controller, frame(0x300, b"\1"))
    bus.send(a.controller, frame(0x201))
    bus.send(b.controller, frame(0x300, b"\2"))
    bus.send(b.controller, frame(0x080))
    bus.run_until(10**7)
    assert [can_id for _, can_id in listener.heard] == [0x080, 0x201, 0x300, 0x300]
    assert [can_id for _, can_id in a.heard] == [0x080, 0x300]


def test_a_frame_is_heard_at_its_end_and_the_next_begins_after_the_interframe_space(bus: Bus) -> None:
    sender, listener = Ear(bus), Ear(bus)
    frames = [frame(0x080), frame(0x181, bytes(8)), frame(0x182, b"\xaa\x55")]
    for raw in frames:
        bus.send(sender.controller, raw)
    bus.run_until(10**7)
    expected, start = [], 0
    for raw in frames:
        end = start + frame_bits(raw) * BIT_NS
        expected.append(end)
        start = end + 3 * BIT_NS
    assert [t for t, _ in listener.heard] == expected


def test_a_frame_on_the_wire_is_not_pre_empted(bus: Bus) -> None:
    sender, listener = Ear(bus), Ear(bus)
    bus.send(sender.controller, frame(0x700, bytes(8)))
    bus.run_until(20_000)
    bus.send(sender.controller, frame(0x001))
    bus.run_until(10**7)
    assert [can_id for _, can_id in listener.heard] == [0x700, 0x001]


def test_frames_of_one_moment_arbitrate_before_the_bus_moves(bus: Bus) -> None:
    sender, listener = Ear(bus), Ear(bus)
    bus.run_until(5_000)
    bus.send(sender.controller, frame(0x300))
    bus.run_until(5_000)
    bus.send(sender.controller, frame(0x100))
    bus.run_until(10**6)
    assert [can_id for _, can_id in listener.heard] == [0x100, 0x300]


def test_nothing_ends_later_than_asked_for(bus: Bus) -> None:
    sender, listener = Ear(bus), Ear(bus)
    raw = frame(0x181, bytes(8))
    bus.send(sender.controller, raw)
    end = frame_bits(raw) * BIT_NS
    bus.run_until(end - 1)
    assert listener.heard == []
    assert bus.quiet_ns() == end
    bus.run_until(end)
    assert listener.heard == [(end, 0x181)]
    assert bus.quiet_ns() is None


def test_the_bus_is_quiet_when_it_says_so_and_not_much_earlier(bus: Bus) -> None:
    sender, listener = Ear(bus), Ear(bus)
    # Alternating runs of five: the data that stuffing makes longest.
    for can_id, data in ((0x181, bytes(8)), (0x182, b"\xf8\x3e\x0f\x83\xe0\xf8\x3e\x0f"), (0x183, b"\x55" * 8)):
        bus.send(sender.controller, frame(can_id, data))
    quiet = bus.quiet_ns()
    assert quiet is not None
    bus.run_until(quiet)
    assert [can_id for _, can_id in listener.heard] == [0x181, 0x182, 0x183]
    assert listener.heard[-1][0] > 0.75 * quiet


def test_a_full_queue_loses_the_newest_frame(bus: Bus) -> None:
    sender, listener = Ear(bus, depth=2), Ear(bus)
    assert [bus.send(sender.controller, frame(0x300 - k)) for k in range(3)] == [True, True, False]
    assert sender.controller.lost == 1
    bus.run_until(10**6)
    assert [can_id for _, can_id in listener.heard] == [0x2FF, 0x300]
    assert bus.send(sender.controller, frame(0x10))


def test_bit_rate_scales_time() -> None:
    slow = Bus("slow", 250_000, 0)
    sender, listener = Ear(slow), Ear(slow)
    raw = frame(0x123, b"\x12\x34")
    slow.send(sender.controller, raw)
    slow.run_until(10**7)
    assert listener.heard[0][0] == frame_bits(raw) * 4000


def test_a_detached_controller_sends_nothing_more(bus: Bus) -> None:
    sender, listener = Ear(bus), Ear(bus)
    bus.send(sender.controller, frame(0x100))
    bus.detach(sender.controller)
    bus.run_until(10**6)
    assert listener.heard == []


def test_an_exchange_at_once_takes_no_time_and_hears_the_reaction(bus: Bus) -> None:
    host, node = Ear(bus), Controller(4)
    bus.attach(node)
    bus.listen(0x601, node, lambda _t, _raw: bus.send(node, frame(0x581)) and None)
    bus.exchange_at_once(host.controller, frame(0x601))
    assert host.heard == [(0, 0x581)]
    assert bus.clock_ns == 0
