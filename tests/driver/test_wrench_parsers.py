"""Parsers of the wrench sensors against frames made from the manuals, and against noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.schema import WrenchSensor
from driver.wrench import SampleStatus, WrenchParser, make_parser
from driver.wrench.bota import BotaParser
from driver.wrench.crc import crc16_modbus, crc16_x25

Encoders = dict[str, Callable[..., bytes]]
NOW = 1_700_000_000_000_000_000


def f32(values: np.ndarray) -> tuple[float, ...]:
    return tuple(values.astype("<f4").astype(float).tolist())


def stream(kind: str, encoders: Encoders, number: int, seed: int = 1) -> tuple[list[tuple[float, ...]], list[bytes]]:
    """``number`` frames and the wrenches in them, many of which hold the protocol's header bytes."""
    rng = np.random.default_rng(seed)
    wrenches, frames = [], []
    for k in range(number):
        if kind == "bota":
            wrench = f32(rng.normal(scale=[100, 100, 100, 5, 5, 5]))
            frames.append(encoders["bota"](wrench, 1000 * k + 5))
        else:
            counts = tuple(int(c) for c in rng.integers(-29_000, 29_000, 6))
            if k % 5 == 0:
                counts = (0x4E20,) + counts[1:]
            wrench = tuple(c / 100 for c in counts[:3]) + tuple(c / 1000 for c in counts[3:])
            frames.append(encoders["robotiq"](counts))
        wrenches.append(wrench)
    return wrenches, frames


def parser_of(kind: str, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor) -> WrenchParser:
    return make_parser(bota_sensor if kind == "bota" else robotiq_sensor)


def test_checksums_have_the_catalogued_check_values() -> None:
    assert crc16_x25(b"123456789") == 0x906E
    assert crc16_modbus(b"123456789") == 0x4B37


@pytest.mark.parametrize("kind", ["bota", "robotiq"])
@given(cuts=st.lists(st.integers(1, 60), min_size=1, max_size=200))
@settings(max_examples=50, deadline=None)
def test_frames_split_anywhere_give_the_same_samples(
    kind: str, cuts: list[int], frame_of: Encoders, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor
) -> None:
    wrenches, frames = stream(kind, frame_of, 40)
    data, got, at = b"".join(frames), list[tuple[float, ...]](), 0
    parser = parser_of(kind, bota_sensor, robotiq_sensor)
    for cut in (*cuts, len(data)):
        got += [s.values for s in parser.feed(data[at : at + cut], NOW)]
        at += cut
    assert got == wrenches
    assert parser.rejected_bytes == 0


@pytest.mark.parametrize("kind", ["bota", "robotiq"])
def test_one_corrupt_byte_costs_one_frame(
    kind: str, frame_of: Encoders, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor
) -> None:
    """Every byte of a frame in turn, also turned into header bytes: the neighbours come out untouched."""
    wrenches, frames = stream(kind, frame_of, 6)
    size = len(frames[0])
    for position in range(size):
        for value in (0x00, 0xAA, 0x20, 0x4E, 0xFF, frames[2][position] ^ 0x01):
            if value == frames[2][position]:
                continue
            broken = bytearray(frames[2])
            broken[position] = value
            parser = parser_of(kind, bota_sensor, robotiq_sensor)
            samples = parser.feed(b"".join([*frames[:2], bytes(broken), *frames[3:]]), NOW)
            assert [s.values for s in samples] == wrenches[:2] + wrenches[3:], (position, value)
            assert parser.rejected_bytes == size


@pytest.mark.parametrize("kind", ["bota", "robotiq"])
@pytest.mark.parametrize("lost", [1, 7, 15])
def test_lost_bytes_cost_at_most_two_frames(
    kind: str, lost: int, frame_of: Encoders, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor
) -> None:
    wrenches, frames = stream(kind, frame_of, 12)
    data = b"".join(frames)
    for start in range(len(frames[0]) * 3, len(frames[0]) * 5):
        parser = parser_of(kind, bota_sensor, robotiq_sensor)
        samples = parser.feed(data[:start] + data[start + lost :], NOW)
        assert len(samples) >= len(frames) - 2
        assert samples[-1].values == wrenches[-1]


@pytest.mark.parametrize("kind", ["bota", "robotiq"])
def test_a_frame_is_found_as_soon_as_it_is_complete(
    kind: str, frame_of: Encoders, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor
) -> None:
    """After garbage that ends in a header, nothing waits for bytes beyond the frame."""
    wrenches, frames = stream(kind, frame_of, 2)
    parser = parser_of(kind, bota_sensor, robotiq_sensor)
    for head in (b"\xaa", b"\x20\x4e", b"\x20"):
        assert parser.feed(b"\x00\x01" + head, NOW) == []
        assert [s.values for s in parser.feed(frames[0], NOW)] == wrenches[:1]


@pytest.mark.parametrize(("kind", "size"), [("bota", 1_000_000), ("robotiq", 200_000)])
def test_no_wrench_that_was_not_sent_passes_as_good(
    kind: str, size: int, frame_of: Encoders, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor
) -> None:
    """Bytes flipped, lost, doubled and invented all over a long stream: what is accepted was sent, in order."""
    rng = np.random.default_rng(7)
    count = 400
    wrenches, frames = stream(kind, frame_of, count)
    sent = {w: k for k, w in enumerate(wrenches)}
    fed = accepted = 0
    while fed < size:
        pieces = []
        for frame in frames:
            fate = rng.random()
            piece = bytearray(frame)
            if fate < 0.1:
                piece[rng.integers(len(piece))] = rng.integers(256)
            elif fate < 0.2:
                del piece[(at := int(rng.integers(len(piece)))) : at + int(rng.integers(1, 9))]
            elif fate < 0.3:
                piece += rng.bytes(int(rng.integers(1, 80))).replace(b"\x00", frame[:1])
            elif fate < 0.35:
                piece += piece[: int(rng.integers(1, len(piece)))]
            pieces.append(bytes(piece))
        data = b"".join(pieces)
        parser = parser_of(kind, bota_sensor, robotiq_sensor)
        samples, at = [], 0
        while at < len(data):
            step = int(rng.integers(1, 300))
            samples += parser.feed(data[at : at + step], NOW)
            at += step
        good = [sent[s.values] for s in samples if s.fresh]
        assert all(a < b for a, b in pairwise(good))
        accepted += len(good)
        fed += len(data)
    assert accepted > 0.7 * fed / (len(data) / count)


@pytest.mark.parametrize("kind", ["bota", "robotiq"])
@given(noise=st.binary(max_size=4000))
@settings(max_examples=200, deadline=None)
def test_noise_is_never_a_wrench_and_every_byte_is_accounted_for(
    kind: str, noise: bytes, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor
) -> None:
    parser = parser_of(kind, bota_sensor, robotiq_sensor)
    assert not any(s.fresh for s in parser.feed(noise, NOW))
    frames = parser.refused * parser.frame_bytes
    assert len(noise) - parser.frame_bytes < parser.rejected_bytes + frames <= len(noise)


@pytest.mark.parametrize(
    ("status", "fresh"),
    [
        (0, True),
        (SampleStatus.SKIPPED, True),
        (SampleStatus.OVER_RANGE, False),
        (SampleStatus.INVALID, False),
        (SampleStatus.RAW_GAUGES, False),
        (SampleStatus.SKIPPED | SampleStatus.INVALID, False),
        (1 << 9, False),
    ],
)
def test_status_bits_decide_validity(status: int, fresh: bool, frame_of: Encoders, bota_sensor: WrenchSensor) -> None:
    parser = BotaParser(bota_sensor)
    parser.feed(frame_of["bota"]((0.0,) * 6, 0), NOW)
    (sample,) = parser.feed(frame_of["bota"]((1.0, 2, 3, 0.5, 0, 0), 1000, status), NOW + 1_000_000)
    assert sample.fresh is fresh
    assert sample.status & 0xFFFF == status
    assert parser.samples == int(fresh)


@pytest.mark.parametrize(
    ("wrench", "finding"),
    [
        ((501.0, 0, 0, 0, 0, 0), SampleStatus.BEYOND_CONFIGURED_RANGE),
        ((0, 0, 0, 0, 0, -20.5), SampleStatus.BEYOND_CONFIGURED_RANGE),
        ((0, math.nan, 0, 0, 0, 0), SampleStatus.NOT_FINITE),
        ((0, 0, 0, math.inf, 0, 0), SampleStatus.NOT_FINITE),
    ],
)
def test_what_the_sensor_cannot_measure_is_refused(
    wrench: tuple[float, ...], finding: SampleStatus, frame_of: Encoders, bota_sensor: WrenchSensor
) -> None:
    parser = BotaParser(bota_sensor)
    parser.feed(frame_of["bota"]((0.0,) * 6, 0), NOW)
    (sample,) = parser.feed(frame_of["bota"](wrench, 1000), NOW + 1_000_000)
    assert not sample.fresh
    assert sample.status & finding
    assert parser.refused == 2  # the first frame of a stream only starts the clock


def test_time_stamps_go_on_across_the_wrap(frame_of: Encoders, bota_sensor: WrenchSensor) -> None:
    """71.6 minutes: the counter passes 2^32 µs and the host's times keep their distance of 1 ms."""
    parser = BotaParser(bota_sensor)
    first = 2**32 - 5_500
    stamps = []
    for k in range(12):
        (sample,) = parser.feed(frame_of["bota"]((k,) * 6, first + 1000 * k), NOW + k * 1_000_000 + 50_000 * (k % 3))
        assert sample.fresh is (k > 0)
        stamps.append(sample.stamp_ns)
    assert np.diff(stamps[1:]) == pytest.approx(1_000_000, abs=60_000)
    assert len(set(np.diff(stamps[4:]).tolist()) - set(range(999_000, 1_001_001))) == 0


def test_stamps_take_delivery_jitter_out(frame_of: Encoders, bota_sensor: WrenchSensor) -> None:
    """Bursts every 16 ms, as of an FTDI chip's timer, still give the sensor's own distances."""
    parser = BotaParser(bota_sensor)
    stamps = []
    for burst in range(1, 40):
        data = b"".join(frame_of["bota"]((0.0,) * 6, 1000 * k) for k in range(16 * (burst - 1), 16 * burst))
        stamps += [s.stamp_ns for s in parser.feed(data, NOW + 16_000_000 * burst)]
    assert np.abs(np.diff(stamps[16:]) - 1_000_000).max() < 10_000


def test_a_restarted_sensor_is_believed_at_its_second_frame(frame_of: Encoders, bota_sensor: WrenchSensor) -> None:
    parser = BotaParser(bota_sensor)
    fresh = []
    for k, time_us in enumerate([0, 1000, 2000, 9_000_000, 9_001_000, 9_002_000]):
        (sample,) = parser.feed(frame_of["bota"]((k,) * 6, time_us), NOW + k * 1_000_000)
        fresh.append(sample.fresh)
        assert bool(sample.status & SampleStatus.TIME_JUMP) is not sample.fresh
    assert fresh == [False, True, True, False, True, True]


def test_a_frame_sent_twice_counts_once(frame_of: Encoders, bota_sensor: WrenchSensor) -> None:
    """A sensor that repeats itself, time stamp and all, measures nothing."""
    parser = BotaParser(bota_sensor)
    frames = [frame_of["bota"]((k,) * 6, 1000 * k) for k in range(3)]
    samples = parser.feed(frames[0] + frames[1] + frames[1] + frames[1] + frames[2], NOW)
    assert [s.fresh for s in samples] == [False, True, False, False, True]


def test_frames_without_time_are_dated_back_by_the_period(frame_of: Encoders, robotiq_sensor: WrenchSensor) -> None:
    parser = make_parser(robotiq_sensor)
    samples = parser.feed(b"".join(frame_of["robotiq"]((k,) * 6) for k in range(3)), NOW)
    assert np.diff([s.stamp_ns for s in samples]).tolist() == [10_000_000, 10_000_000]
    assert samples[-1].stamp_ns < NOW


def test_stale_after_the_configured_time(frame_of: Encoders, robotiq_sensor: WrenchSensor) -> None:
    parser = make_parser(robotiq_sensor)
    assert parser.stale(NOW)
    parser.feed(frame_of["robotiq"]((0,) * 6), NOW)
    assert not parser.stale(NOW + 79_000_000)
    assert parser.stale(NOW + 81_000_000)
    assert parser.age_ns(NOW + 5) == 5
    parser.feed(frame_of["robotiq"]((32_000,) * 6), NOW + 81_000_000)
    assert parser.stale(NOW + 81_000_000), "a refused sample is no sign of life"


def test_x25_agrees_with_its_definition_bit_by_bit() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        data = rng.bytes(int(rng.integers(0, 60)))
        crc = 0xFFFF
        for byte in data:
            crc ^= byte
            for _ in range(8):
                crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
        assert crc16_x25(data) == crc ^ 0xFFFF


@pytest.mark.parametrize("kind", ["bota", "robotiq"])
def test_a_reading_that_stands_still_is_no_measurement(
    kind: str, frame_of: Encoders, bota_sensor: WrenchSensor, robotiq_sensor: WrenchSensor
) -> None:
    """The fifth equal frame and all after it are refused, though a SensONE's clock goes on; another one counts."""
    parser, period_ns = parser_of(kind, bota_sensor, robotiq_sensor), 10_000_000

    def fed(k: int, counts: int) -> bool:
        reading = (counts, -200, 300, 40, 50, 60)
        frame = frame_of[kind](*([reading] if kind == "robotiq" else [reading_of(reading), 10_000 * k]))
        (sample,) = parser.feed(frame, NOW + k * period_ns)
        assert bool(sample.status & SampleStatus.STANDS_STILL) is parser.stands_still
        return sample.fresh

    def reading_of(counts: tuple[int, ...]) -> tuple[float, ...]:
        return f32(np.array(counts) / 100)

    assert [fed(k, 7 + k) for k in range(3)] == [kind == "robotiq", True, True], "a SensONE's first frame is not judged"
    assert [fed(k, 100) for k in range(3, 11)] == [True] * 4 + [False] * 4
    # The last three of them came 80 ms after the last good one.
    assert not parser.stale(NOW + 7 * period_ns) and parser.stale(NOW + 15 * period_ns)
    assert [fed(11, 101), fed(12, 100)] == [True, True]
    assert not parser.stands_still


def test_noise_of_one_digit_never_stands_still(frame_of: Encoders, robotiq_sensor: WrenchSensor) -> None:
    """Ten minutes of the quietest sensor at rest: rounded noise whose standard deviation is a digit on each channel."""
    parser = make_parser(robotiq_sensor)
    noise = np.rint(np.random.default_rng(5).normal(0.0, 1.0, (60_000, 6))).astype(int).tolist()
    assert sum(a == b for a, b in pairwise(noise)) > 10, "single repetitions come by chance"
    samples = parser.feed(b"".join(frame_of["robotiq"](tuple(counts)) for counts in noise), NOW)
    assert len(samples) == len(noise)
    assert all(sample.fresh for sample in samples)
