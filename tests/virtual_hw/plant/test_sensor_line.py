"""Both wrist sensors at the level of bytes, read from their pty as a host would."""

from __future__ import annotations

import math
import os
import select
import struct
import termios
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from config import InputError, Installation
from virtual_hw.hidden import parse_hidden
from virtual_hw.plant import Plant, build_plant
from virtual_hw.wrench import Sensor, build_sensors
from virtual_hw.wrench.crc import crc_modbus, crc_x25

HELD = [True, True]
ANSWER_S = 2.0
BOTA = struct.Struct("<BH6fIfH")
ROBOTIQ = struct.Struct("<2s6hH")


class Bench:
    """An arm with its sensor, and the host's end of the line."""

    def __init__(self, installation: Installation, hidden: str, folder: Path, seed: int = 1) -> None:
        mechanics = parse_hidden(hidden, installation)
        self.plant: Plant = build_plant(installation, mechanics, seed)
        (self.sensor,) = build_sensors(installation, mechanics, self.plant, seed, folder)
        self.path = folder / "wrist"
        self.fd = -1
        self.connect()

    def connect(self) -> None:
        self.fd = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.fd)
        os.set_blocking(self.fd, False)

    def run(self, ticks: int) -> bytes:
        """Advance the arm; the bytes that came."""
        received = b""
        for _ in range(ticks):
            self.plant.advance([0.0, 0.0], HELD)
            before = self.sensor.total_bytes
            self.sensor.advance(self.plant.time_ns)
            received += self.read(self.sensor.total_bytes - before)
        return received

    def ask(self, text: bytes, patience_s: float = ANSWER_S) -> bytes:
        """Write to the sensor; its answer, in no time."""
        os.write(self.fd, text)
        termios.tcdrain(self.fd)
        before = self.sensor.total_bytes
        deadline = time.monotonic() + patience_s
        while self.sensor.total_bytes == before and time.monotonic() < deadline:
            # The kernel's line discipline hands the bytes over when it gets the processor.
            select.select([self.sensor], [], [], 0.001)
            self.sensor.advance(self.plant.time_ns)
        return self.read(self.sensor.total_bytes - before)

    def read(self, size: int) -> bytes:
        data = b""
        os.set_blocking(self.fd, True)
        while len(data) < size:
            data += os.read(self.fd, size - len(data))
        os.set_blocking(self.fd, False)
        return data

    def close(self) -> None:
        if self.fd >= 0:
            os.close(self.fd)
            self.fd = -1
        self.sensor.close()


@pytest.fixture
def benches(tmp_path) -> Iterator[list[Bench]]:
    open_benches: list[Bench] = []
    yield open_benches
    for bench in open_benches:
        bench.close()


@pytest.fixture
def make_bench(two_joints, tmp_path, benches):
    def make(hidden: str = "", seed: int = 1, folder: str = "", **changes: object) -> Bench:
        sensor = two_joints.wrench_sensor[0].model_copy(update=changes)
        installation = two_joints.model_copy(update={"wrench_sensor": (sensor,)})
        bench = Bench(installation, hidden, tmp_path / folder if folder else tmp_path, seed)
        benches.append(bench)
        return bench

    return make


def bota_frames(data: bytes) -> list[tuple[float, ...]]:
    assert len(data) % BOTA.size == 0
    frames = [BOTA.unpack_from(data, at) for at in range(0, len(data), BOTA.size)]
    for at, frame in zip(range(0, len(data), BOTA.size), frames, strict=True):
        assert frame[0] == 0xAA
        assert frame[-1] == crc_x25(data[at + 1 : at + 35])
    return frames


def configured(bench: Bench) -> Bench:
    for command in (b"C\r\n", b"R\r\n"):
        assert bench.ask(command) == b"r,0," + command[:1] + b",0\r\n"
    return bench


def test_check_values_of_both_sums():
    assert crc_x25(b"123456789") == 0x906E
    assert crc_modbus(b"123456789") == 0x4B37
    # The vendor's request that starts the stream: 09 10 01 9A 00 01 02 02 00 CD CA.
    assert crc_modbus(bytes.fromhex("0910019A0001020200")).to_bytes(2, "little") == bytes.fromhex("CDCA")


def test_bota_streams_the_load_s_weight_at_its_rate(make_bench):
    bench = configured(make_bench())
    frames = bota_frames(bench.run(1004)[: 790 * BOTA.size])
    assert len(frames) == 790
    stamps = np.array([f[9 - 1] for f in frames])
    np.testing.assert_allclose(np.diff(stamps), 1e6 * 64 / 51_200, atol=1.01)
    fx, _, fz = np.mean([f[2:5] for f in frames[-100:]], axis=0)
    # Wrist at lift −0.4: 0.5 kg held against gravity.
    assert fz == pytest.approx(0.5 * 9.81 * math.cos(0.4), abs=1e-4)
    assert fx == pytest.approx(0.5 * 9.81 * math.sin(0.4), abs=1e-4)
    assert {f[1] for f in frames} == {0}


def test_bota_bytes_leave_at_line_speed(make_bench):
    bench = configured(make_bench(baud=460_800))
    bench.run(100)
    per_ms = [len(bench.run(1)) for _ in range(50)]
    assert max(per_ms) <= 47
    assert sum(per_ms) == pytest.approx(800 * 0.05 * 37, abs=37)
    # A frame lasts 803 µs, so milliseconds end inside of frames.
    assert any(count % 37 for count in per_ms)


def test_usb_bridge_delivers_in_bursts(make_bench):
    bench = configured(make_bench('[[wrench_sensor]]\nsensor = "wrist"\nlatency_ms = 16.0\n'))
    per_ms = [len(bench.run(1)) for _ in range(161)]
    arrivals = np.flatnonzero(per_ms)
    assert set(np.diff(arrivals)) == {16}


def test_bota_configuration(make_bench):
    bench = make_bench()
    assert bench.ask(b"C\r\n") == b"r,0,C,0\r\n"
    assert bench.run(20) == b""
    for command, code in (
        (b"c,1,1,0,4", 0),
        (b"f,512,0,0,1", 0),
        (b"f,50,0,0,1", 1),
        (b"f,100.5,0,0,1", 1),
        (b"f,512", 1),
        (b"c,1,1,1,4", 1),
        (b"c,1,1,0,9", 1),
        (b"b,1,2,3,4,5,nan", 1),
        (b"b,1,2,3,4,5,1e300", 1),
        (b"b,1,0,0,0,0,0", 0),
        (b"m5,0,0,0,0,0,2", 0),
        (b"s", 0),
        (b"x", 1),
    ):
        name = command.split(b",")[0]
        assert bench.ask(command + b"\r\n") == b"r,0,%s,%d\r\n" % (name, code)
    assert b"f,512,0,0,1" in bench.ask(b"w\r\n")
    assert bench.ask(b"R\r\n") == b"r,0,R,0\r\n"
    frames = bota_frames(bench.run(1001)[: 99 * 37])
    assert np.median(np.diff([f[8] for f in frames])) == 10_000
    assert frames[-1][2] == pytest.approx(0.5 * 9.81 * math.sin(0.4) + 1.0, abs=1e-4)


def test_bota_refuses_a_rate_that_its_line_cannot_carry(make_bench):
    bench = make_bench()
    bench.ask(b"C\r\n")
    assert bench.ask(b"f,512,0,0,1\r\n") == b"r,0,f,0\r\n"
    assert bench.ask(b"c,1,1,0,2\r\n") == b"r,0,c,0\r\n"
    assert bench.ask(b"f,51,0,0,1\r\n") == b"r,0,f,1\r\n"


def test_bota_status_bits(make_bench):
    over = configured(make_bench(range_n=2.0, folder="over"))
    frame = bota_frames(over.run(40)[: 20 * 37])[-1]
    assert frame[1] == 2
    assert frame[4] == pytest.approx(2.0)
    raw = make_bench(folder="raw")
    raw.ask(b"C\r\n")
    raw.ask(b"c,1,0,0,4\r\n")
    raw.ask(b"R\r\n")
    assert bota_frames(raw.run(40)[: 20 * 37])[-1][1] == 8


def test_bota_clock_wraps(make_bench):
    hidden = f'[[wrench_sensor]]\nsensor = "wrist"\nfirst_timestamp_us = {2**32 - 20_000}\n'
    stamps = [f[8] for f in bota_frames(configured(make_bench(hidden)).run(50)[: 35 * 37])]
    assert max(stamps) > 2**32 - 20_000
    assert min(stamps) < 40_000
    assert set(np.diff(np.array(stamps, dtype=np.uint32))) == {1250}


def test_nobody_on_the_line_hears_nothing_and_later_no_stale_bytes(make_bench):
    bench = configured(make_bench())
    bench.run(20)
    os.close(bench.fd)
    bench.fd = -1
    before = bench.sensor.total_bytes
    for _ in range(100):
        bench.plant.advance([0.0, 0.0], HELD)
        bench.sensor.advance(bench.plant.time_ns)
    assert bench.sensor.total_bytes == before
    bench.connect()
    fresh = bench.run(50)
    start = next(
        k
        for k in range(37)
        if fresh[k] == 0xAA and crc_x25(fresh[k + 1 : k + 35]) == int.from_bytes(fresh[k + 35 : k + 37], "little")
    )
    assert BOTA.unpack_from(fresh, start)[8] >= 119_000


def test_same_seed_same_bytes(make_bench):
    noisy = '[[wrench_sensor]]\nsensor = "wrist"\nforce_noise = { white = 0.1, coloured = 0.1 }\n'
    runs = [configured(make_bench(noisy, seed, f"run{k}")).run(200) for k, seed in enumerate((4, 4, 5))]
    assert runs[0] == runs[1]
    assert runs[0] != runs[2]


def test_link_is_removed_at_the_end_and_a_file_in_its_place_respected(make_bench, tmp_path):
    bench = make_bench()
    assert bench.path.is_symlink()
    bench.close()
    assert not bench.path.is_symlink()
    bench.sensor = _Closed()
    (tmp_path / "wrist").write_text("mine")
    with pytest.raises(InputError, match="in the way"):
        make_bench()


class _Closed:
    def close(self) -> None:
        pass


def modbus(body: bytes) -> bytes:
    return body + crc_modbus(body).to_bytes(2, "little")


@pytest.fixture
def robotiq(make_bench) -> Bench:
    return make_bench(protocol="robotiq", baud=19_200, rate_hz=100.0, range_n=300.0, range_nm=30.0)


START = modbus(bytes.fromhex("0910019A0001020200"))


def test_robotiq_is_silent_until_told_and_stops_on_fifty_ff(robotiq):
    assert robotiq.run(50) == b""
    assert robotiq.ask(START) == modbus(bytes.fromhex("0910019A0001"))
    data = robotiq.run(1001)
    frames = [data[k : k + 16] for k in range(0, len(data) - 15, 16)]
    assert len(frames) in (99, 100)
    for frame in frames:
        header, fx, _, fz, *_, crc = ROBOTIQ.unpack(frame)
        assert header == b"\x20\x4e"
        assert crc == crc_modbus(frame[:14])
    assert fz == round(100 * 0.5 * 9.81 * math.cos(0.4))
    assert fx == round(100 * 0.5 * 9.81 * math.sin(0.4))
    # 16 bytes take 8.33 ms at 19 200 baud.
    assert max(len(robotiq.run(1)) for _ in range(30)) <= 2
    os.write(robotiq.fd, b"\xff" * 49)
    assert len(robotiq.run(100)) > 100
    os.write(robotiq.fd, b"\xff" * 50)
    robotiq.run(30)
    assert robotiq.run(100) == b""


def test_robotiq_registers(robotiq):
    robotiq.run(50)
    firmware = robotiq.ask(modbus(bytes.fromhex("090301F40003")))
    assert firmware[:3] == b"\x09\x03\x06"
    assert firmware[3:6] == b"FTS"
    assert modbus(firmware[:-2]) == firmware
    wrench = robotiq.ask(modbus(bytes.fromhex("090300B40006")))
    assert struct.unpack(">6h", wrench[3:15])[2] == round(100 * 0.5 * 9.81 * math.cos(0.4))
    for request, code in (
        ("090300010001", 2),  # no such register
        ("0910019B0001020200", 2),
        ("0910019A0001020300", 3),
        ("0901000A0001", 1),
    ):
        answer = robotiq.ask(modbus(bytes.fromhex(request)))
        assert answer == modbus(bytes([9, int(request[2:4], 16) | 0x80, code]))


def test_robotiq_finds_the_request_behind_noise_and_ignores_a_wrong_sum(robotiq):
    broken = START[:-1] + bytes([START[-1] ^ 1])
    assert robotiq.ask(b"\x00\x09\x77" + broken, patience_s=0.05) == b""
    assert robotiq.ask(b"\x31\x09" + START) == modbus(bytes.fromhex("0910019A0001"))


@pytest.mark.parametrize("protocol", ["bota", "robotiq"])
def test_any_bytes_from_the_host_leave_the_sensor_sound(make_bench, protocol):
    bench = make_bench(protocol=protocol, baud=460_800 if protocol == "bota" else 19_200)
    rng = np.random.default_rng(11)
    words = [b"C\r\n", b"c,1,1,0,4\r\n", b"f,512,0,0,1\r\n", b"m0,", b"1e9,", b"\n", START, b"\xff" * 50, b"\x09\x10"]
    for _ in range(400):
        piece = words[rng.integers(len(words))] if rng.random() < 0.5 else rng.bytes(int(rng.integers(1, 40)))
        bench.ask(piece, patience_s=0.002)
        bench.run(1)
        os.set_blocking(bench.fd, False)
    if protocol == "bota":
        bench.ask(b"\r\n" + b"x" * 300 + b"\r\n", patience_s=0.05)
        assert bench.ask(b"C\r\n").endswith(b"r,0,C,0\r\n")
    else:
        os.write(bench.fd, b"\xff" * 50)
        bench.run(300)
        os.write(bench.fd, b"\x00" * 300)
        bench.run(30)
        assert bench.ask(START) == modbus(bytes.fromhex("0910019A0001"))


def _response(profile: str, rate: float, delay: float = 0.0) -> tuple[float, float]:
    """Gain and lag (s) of a sensor's transducer for a 40 Hz wrench."""
    from collections import deque

    from virtual_hw.hidden.wrench_sensor import WrenchErrors
    from virtual_hw.wrench.transducer import PROFILES, Transducer

    tap: deque[tuple[int, list[float]]] = deque()
    transducer = Transducer(tap, WrenchErrors(sensor="wrist", delay_s=delay), PROFILES[profile], 1, 1, 1e-3)
    transducer.start(rate, 0)
    rows = []
    for k in range(3000):
        t = (k + 0.5) * 1e-3
        tap.append((round(t * 1e9), [math.cos(2 * math.pi * 40.0 * t)] * 6))
        rows += transducer.samples(round((k + 1) * 1e6))
    t = np.array([stamp for stamp, _ in rows]) * 1e-9
    y = np.array([value[0] for _, value in rows])
    keep = t > 0.5
    phasor = 2 * np.mean(y[keep] * np.exp(-2j * math.pi * 40.0 * t[keep]))
    return abs(phasor), -float(np.angle(phasor)) / (2 * math.pi * 40.0)


@pytest.mark.parametrize(("profile", "rate", "corners"), [("astek", 240.0, (120.0, 120.0)), ("rti", 200.0, (100.0,))])
def test_filter_profiles_have_the_response_of_their_low_passes(profile, rate, corners):
    gain, lag = _response(profile, rate)
    ideal = 1.0 + 0j
    for corner in corners:
        s = 1j * 40.0 / corner
        ideal /= s * s + math.sqrt(2) * s + 1
    assert gain == pytest.approx(abs(ideal), rel=0.06)
    assert lag == pytest.approx(-np.angle(ideal) / (2 * math.pi * 40.0), rel=0.25)


def test_sinc_sensor_averages_over_its_period_and_a_delay_adds():
    gain, lag = _response("none", 400.0)
    assert gain == pytest.approx(np.sinc(40.0 / 400.0), rel=0.02)
    assert lag == pytest.approx(0.5 / 400.0, rel=0.02)
    assert _response("none", 400.0, delay=3.3e-3)[1] == pytest.approx(0.5 / 400.0 + 3.3e-3, rel=0.01)


def test_errors_of_the_sensor(make_bench):
    matrix = np.eye(6)
    matrix[0, 0] = 1.1
    rotation = 0.2
    hidden = (
        '[[wrench_sensor]]\nsensor = "wrist"\nbias = [1.0, 2.0, 3.0, 0.1, 0.2, 0.3]\n'
        "drift_per_s = [0, 10.0, 0, 0, 0, 0]\n"
        f"matrix = {matrix.tolist()}\nrotation_rad = [0.0, {rotation}, 0.0]\n"
    )
    bench = configured(make_bench(hidden))
    frame = bota_frames(bench.run(500)[: 380 * 37])[-1]
    # Turned by 0.2 about y on top of lift = −0.4: gravity stands at −0.2 in the sensor.
    angle = -0.4 + rotation
    assert frame[2] == pytest.approx(1.1 * 0.5 * 9.81 * -math.sin(angle) + 1.0, abs=1e-3)
    assert frame[4] == pytest.approx(0.5 * 9.81 * math.cos(angle) + 3.0, abs=1e-3)
    assert frame[3] == pytest.approx(2.0 + 10.0 * frame[8] * 1e-6, abs=0.02)
    assert frame[5:8] == pytest.approx((0.1, 0.2 + 0.05 * 0.5 * 9.81 * math.sin(0.4), 0.3), abs=1e-3)


def test_a_real_port_cannot_be_stood_in_for(make_bench):
    with pytest.raises(InputError, match="/dev/ttyUSB0"):
        make_bench(port="/dev/ttyUSB0")


def test_sensors_share_one_type(make_bench, robotiq):
    assert isinstance(robotiq.sensor, Sensor)
