"""What an enabled axis does with its targets: servo, interpolation, limits, signs."""

from __future__ import annotations

import itertools
import math
import struct
from collections.abc import Callable
from typing import Any

import pytest

from virtual_hw.drive.emergency import ErrorCode
from virtual_hw.drive.servo import Servo
from virtual_hw.drive.states import PowerState

COUNTS = 65536 / (2 * math.pi)
RATED_NM = 66.0


def enabled(bench: Any, mode: int) -> Any:
    """Commissioned and brought to operation enabled by RPDOs."""
    bench.commission(mode)
    position = bench.arm.counts(0)
    for word in (0x06, 0x07, 0x0F, 0x0F, 0x0F):
        if mode == 8:
            bench.cycle(struct.pack("<Hih", word, position, 0))
        else:
            bench.cycle(struct.pack("<Hi" if mode == 9 else "<Hh", word, 0))
    assert bench.state is PowerState.OPERATION_ENABLED
    return bench


def test_torque_mode_applies_permille_of_rated_torque(bench: Any) -> None:
    enabled(bench, 10)
    bench.cycle(struct.pack("<Hh", 0x0F, 250))
    bench.cycle(struct.pack("<Hh", 0x0F, 250))
    bench.run(1)
    assert bench.arm.applied[0] == pytest.approx(0.25 * RATED_NM)
    bench.cycle(struct.pack("<Hh", 0x0F, 250))
    assert struct.unpack("<Hih", bench.frames(0x181)[-1])[2] == 250


def test_torque_offset_adds_to_the_target(bench: Any) -> None:
    enabled(bench, 10)
    bench.write(0x60B2, 0, -100, 2)
    bench.cycle(struct.pack("<Hh", 0x0F, 250))
    bench.run(1)
    assert bench.arm.applied[0] == pytest.approx(0.15 * RATED_NM)


def test_torque_limit_clips_and_says_so(bench: Any) -> None:
    enabled(bench, 10)
    bench.write(0x6072, 0, 100, 2)
    bench.cycle(struct.pack("<Hh", 0x0F, -500))
    bench.run(1)
    assert bench.arm.applied[0] == pytest.approx(-0.1 * RATED_NM)
    assert bench.status & 0x0800


def test_torque_mode_does_not_drive_beyond_the_speed_limit(bench: Any) -> None:
    enabled(bench, 10)
    bench.write(0x6080, 0, round(0.5 * COUNTS), 4)
    bench.write(0x607D, 1, 0, 4)
    bench.write(0x607D, 2, 0, 4)
    for _ in range(300):
        bench.cycle(struct.pack("<Hh", 0x0F, 100))
    assert bench.arm.dq[0] == pytest.approx(0.5, abs=0.02)


def test_position_mode_follows_a_ramp_without_lag_in_velocity(bench: Any) -> None:
    enabled(bench, 8)
    start = bench.arm.q[0]
    for k in range(400):
        target = start + 0.4 * k * 1e-3
        bench.cycle(struct.pack("<Hih", 0x0F, round(target * COUNTS), 0))
    # the reference is one cycle late at most, the damping acts on the error of velocity
    assert bench.arm.q[0] == pytest.approx(start + 0.4 * 0.399, abs=1.5e-3)
    assert bench.arm.dq[0] == pytest.approx(0.4, abs=0.01)


def test_position_mode_is_the_stated_pd(bench: Any) -> None:
    enabled(bench, 8)
    position = bench.arm.counts(0)
    offset_counts = 100
    bench.arm.advance = lambda torque, _brake: bench.arm.applied.__setitem__(0, torque[0])  # the arm is held
    for _ in range(10):
        bench.cycle(struct.pack("<Hih", 0x0F, position + offset_counts, 200))
    bench.run(1)
    expected = 400.0 * offset_counts / COUNTS + 0.2 * RATED_NM - 28.0 * bench.arm.dq[0]
    assert bench.arm.applied[0] == pytest.approx(expected, rel=1e-6)


def test_velocity_offset_is_the_velocity_reference_where_it_is_mapped(bench: Any) -> None:
    bench.commission(8)
    bench.nmt(0x80)
    bench.map_pdo(0x1401, [0x60B10020])
    bench.nmt(0x01)
    position = bench.arm.counts(0)
    bench.arm.advance = lambda torque, _brake: bench.arm.applied.__setitem__(0, torque[0])
    for word in (0x06, 0x07, 0x0F, 0x0F, 0x0F, 0x0F):
        bench.send(0x301, struct.pack("<i", round(0.5 * COUNTS)))
        bench.cycle(struct.pack("<Hih", word, position, 0))
    bench.run(1)
    assert bench.arm.applied[0] == pytest.approx(28.0 * 0.5, rel=1e-3)


def test_targets_are_interpolated_over_the_period(bench: Any) -> None:
    enabled(bench, 8)
    bench.write(0x60C2, 1, 4, 1)
    servo = bench.node.axis.motion.servo
    begin = bench.arm.counts(0)
    bench.send(0x201, struct.pack("<Hih", 0x0F, begin + 80, 0))
    bench.run(0.2)
    bench.send(0x080)
    seen = []
    for _ in range(10):
        bench.run(0.5)
        seen.append(round(servo.position) - begin)
    assert seen == [10, 20, 30, 40, 50, 60, 70, 80, 80, 80]


def test_the_slope_of_the_targets_is_reached_without_a_leap() -> None:
    """A velocity reference that leapt at each set-point would make the torque at every SYNC another than between."""
    servo = Servo(65536, tick_ns=500_000)
    servo.set_period(4e-3)
    servo.rest_at(0.0)
    seen = []
    for k in range(1, 8):  # a steady acceleration of 1e6 counts/s², a set-point every 4 ms
        servo.aim(8.0 * k * k, None, 0.0)
        for _ in range(8):
            servo.follow(0.0, 0.0)
            seen.append(servo.velocity)
    steps = [after - before for before, after in itertools.pairwise(seen)]
    assert steps[7:] == pytest.approx([500.0] * len(steps[7:]))


def test_following_error_faults_after_its_time(bench: Any) -> None:
    enabled(bench, 8)
    bench.write(0x6065, 0, 500, 4)
    bench.write(0x6066, 0, 10, 2)
    bench.write(0x6072, 0, 0, 2)
    target = bench.arm.counts(0) + 1000
    cycles = 0
    while bench.state is PowerState.OPERATION_ENABLED:
        cycles += 1
        bench.cycle(struct.pack("<Hih", 0x0F, target, 0))
        assert cycles < 20
    assert 10 <= cycles <= 13
    bench.run(1)
    assert bench.emergencies() == [ErrorCode.FOLLOWING_ERROR]


def test_target_positions_are_kept_within_the_software_limits(bench: Any) -> None:
    enabled(bench, 8)
    limit = bench.arm.counts(0) + 200
    bench.write(0x607D, 1, -100_000, 4)
    bench.write(0x607D, 2, limit, 4)
    for _ in range(500):
        bench.cycle(struct.pack("<Hih", 0x0F, limit + 5000, 0))
    assert bench.arm.counts(0) == pytest.approx(limit, abs=3)
    assert bench.status & 0x0800


def test_torque_mode_faults_beyond_the_software_limits(bench: Any) -> None:
    enabled(bench, 10)
    bench.write(0x607D, 1, -100_000, 4)
    bench.write(0x607D, 2, bench.arm.counts(0) + 300, 4)
    for _ in range(120):
        bench.cycle(struct.pack("<Hh", 0x0F, 300))
        if bench.state is not PowerState.OPERATION_ENABLED:
            break
    bench.run(1500)
    assert bench.state is PowerState.FAULT
    assert bench.read(0x603F) & 0xFFFF == ErrorCode.REFERENCE_LIMIT


def test_velocity_mode(bench: Any) -> None:
    enabled(bench, 9)
    for _ in range(600):
        bench.cycle(struct.pack("<Hi", 0x0F, round(0.3 * COUNTS)))
    assert bench.arm.dq[0] == pytest.approx(0.3, abs=0.01)


def test_mode_display_follows_the_mode(bench: Any) -> None:
    enabled(bench, 8)
    assert bench.read(0x6061) == 8
    bench.write(0x6060, 0, 10, 1)
    assert bench.read(0x6061) == 10


@pytest.mark.parametrize("sign", [1, -1])
def test_all_quantities_of_a_drive_have_its_own_direction(make_bench: Callable[..., Any], sign: int) -> None:
    bench = enabled(make_bench(sign=sign), 10)
    for _ in range(20):
        bench.cycle(struct.pack("<Hh", 0x0F, 100))
    before = bench.read(0x6064)
    for _ in range(20):
        bench.cycle(struct.pack("<Hh", 0x0F, 100))
    assert bench.read(0x6064) > before
    assert bench.read(0x606C) > 0
    assert bench.read(0x6077) == 100
    assert math.copysign(1, bench.arm.dq[0]) == sign


def test_the_statusword_says_that_the_drive_follows(bench: Any) -> None:
    enabled(bench, 8)
    assert bench.status & 0x1000
    bench.controlword(0x02)
    assert not bench.status & 0x1000
