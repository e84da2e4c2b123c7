"""The sensor's serial line: opening, configuration against a sensor on a pty, and what goes wrong."""

from __future__ import annotations

import os
import pty
import select
import struct
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from config import InputError
from config.schema import WrenchSensor
from driver.wrench import SensorLost, WrenchPort, make_parser
from driver.wrench.crc import crc16_modbus
from driver.wrench.port import port_path

Answer = Callable[[bytes], bytes]
Line = tuple[Path, int]


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Line]:
    """A pty linked as ``wrist`` in a run directory, and the device's end of it."""
    device, host = pty.openpty()
    tty.setraw(host)
    (tmp_path / "wrist").symlink_to(os.ttyname(host))
    yield tmp_path, device
    os.close(host)
    os.close(device)


@pytest.fixture
def sensor_thread(line: Line) -> Iterator[Callable[[Answer], list[bytes]]]:
    """Starts a device that answers each piece of what it hears; gives what it has heard."""
    ended, threads = threading.Event(), list[threading.Thread]()

    def start(answer: Answer) -> list[bytes]:
        heard: list[bytes] = []

        def serve() -> None:
            while not ended.is_set():
                if select.select([line[1]], [], [], 0.02)[0]:
                    data = os.read(line[1], 4096)
                    heard.append(data)
                    if reply := answer(data):
                        os.write(line[1], reply)

        threads.append(threading.Thread(target=serve))
        threads[0].start()
        return heard

    yield start
    ended.set()
    for thread in threads:
        thread.join()


def test_a_sensone_is_configured_step_by_step_while_it_streams(
    line: Line, sensor_thread: Callable[[Answer], list[bytes]], bota_sensor: WrenchSensor
) -> None:
    def answer(data: bytes) -> bytes:
        stream = b"\xaa\x01,\r\nr,0\x00\xff" * 3
        return stream + f"r,0,{data.decode().split(',')[0].strip()},0\r\n".encode() + stream[:5]

    heard = sensor_thread(answer)
    with WrenchPort.open(bota_sensor, line[0]) as port:
        port.configure()
    assert heard == [b"C\r\n", b"c,1,1,0,4\r\n", b"f,51,0,0,1\r\n", b"R\r\n"]


def test_a_refused_command_is_named(
    line: Line, sensor_thread: Callable[[Answer], list[bytes]], bota_sensor: WrenchSensor
) -> None:
    sensor_thread(lambda data: b"r,0,f,7\r\n" if data[:1] == b"f" else b"r,0," + data[:1] + b",0\r\n")
    with WrenchPort.open(bota_sensor, line[0]) as port, pytest.raises(InputError, match=r"'f,51,0,0,1' with code 7"):
        port.configure()


def modbus(body: bytes) -> bytes:
    return body + struct.pack("<H", crc16_modbus(body))


def test_an_ft300_is_stopped_identified_and_started(
    line: Line, sensor_thread: Callable[[Answer], list[bytes]], robotiq_sensor: WrenchSensor
) -> None:
    answers = {
        500: modbus(b"\x09\x03\x06FTS\x02\x00\x04"),
        510: modbus(b"\x09\x03\x08FTS\x00\x00\x2a\x00\x00"),
        410: modbus(b"\x09\x10\x01\x9a\x00\x01"),
    }

    def answer(data: bytes) -> bytes:
        if data.startswith(b"\xff"):
            return b"\x20\x4e\x00"
        assert modbus(data[:-2]) == data
        return b"\x09\x03" + answers[struct.unpack(">H", data[2:4])[0]]

    heard = sensor_thread(answer)
    with WrenchPort.open(robotiq_sensor, line[0]) as port:
        port.configure()
        assert port.identity == "firmware FTS-2.0.4, serial number FTS-0042"
    assert heard[0] == b"\xff" * 50
    assert heard[-1] == modbus(b"\x09\x10\x01\x9a\x00\x01\x02\x02\x00")


def test_reading_never_waits_and_counts(
    line: Line, bota_sensor: WrenchSensor, frame_of: dict[str, Callable[..., bytes]]
) -> None:
    with WrenchPort.open(bota_sensor, line[0]) as port:
        assert port.read() == b""
        frames = b"".join(frame_of["bota"]((k, 2, 3, 0, 0, 0), 1000 * k) for k in range(20))
        os.write(line[1], frames)
        assert port.read_up_to(100, 1.0) == frames[:100]
        assert port.read_up_to(len(frames), 1.0) == frames[100:]
        assert port.received == len(frames)
        assert sum(s.fresh for s in make_parser(bota_sensor).feed(frames, 0)) == 19
        with pytest.raises(SensorLost, match="3 of the bytes announced did not come"):
            port.read_up_to(len(frames) + 3, 0.02)


def test_a_pulled_cable_is_no_silence(line: Line, bota_sensor: WrenchSensor) -> None:
    device, host = pty.openpty()
    tty.setraw(host)
    sensor = bota_sensor.model_copy(update={"port": os.ttyname(host)})
    with WrenchPort.open(sensor) as port:
        os.close(host)
        os.close(device)
        with pytest.raises(SensorLost, match=r"wrist: its line /dev/pts/.* is gone"):
            port.read()


def test_an_absent_sensor_is_one_sentence(tmp_path: Path, bota_sensor: WrenchSensor) -> None:
    with pytest.raises(InputError, match=r"sensor wrist: there is no sensor at .*wrist; start the stand-in first"):
        WrenchPort.open(bota_sensor, tmp_path)
    with pytest.raises(InputError, match="there is no sensor at /dev/ttyNONE; plug it in"):
        WrenchPort.open(bota_sensor.model_copy(update={"port": "/dev/ttyNONE"}))


def test_a_file_is_no_serial_line(tmp_path: Path, bota_sensor: WrenchSensor) -> None:
    (tmp_path / "wrist").write_text("hello")
    with pytest.raises(InputError, match=r"cannot be opened at 460800 baud|is not a serial line"):
        WrenchPort.open(bota_sensor, tmp_path)


def test_no_permission_is_said_with_the_group(
    line: Line, bota_sensor: WrenchSensor, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("serial.serialposix.os.open", refuse)
    with pytest.raises(InputError, match=r"no permission to open .*; add this user to the group"):
        WrenchPort.open(bota_sensor, line[0])


def test_a_line_that_another_process_has_open_is_refused(line: Line, bota_sensor: WrenchSensor) -> None:
    code = "import sys, serial; s = serial.Serial(sys.argv[1], exclusive=True); print('open', flush=True); input()"
    path = port_path(bota_sensor, line[0])
    with subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "open\n"
        with pytest.raises(InputError, match=r"another process has .* open"):
            WrenchPort.open(bota_sensor, line[0])
        other.communicate("\n")


def test_two_sensors_cannot_share_a_line(line: Line, bota_sensor: WrenchSensor) -> None:
    with WrenchPort.open(bota_sensor, line[0]), pytest.raises(InputError, match=r"has .* open; end it"):
        WrenchPort.open(bota_sensor, line[0])


def test_silence_and_a_wrong_baud_rate_are_told_apart(
    line: Line, bota_sensor: WrenchSensor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("driver.wrench.port.ANSWER_S", 0.05)
    with WrenchPort.open(bota_sensor, line[0]) as port:
        with pytest.raises(InputError, match=r"nothing on .* answers command 'C'; check cable and power"):
            port.configure()
        os.write(line[1], b"\xf8\x00\xf8" * 30)
        with pytest.raises(InputError, match=r"90 bytes came .* no answer .*; check the baud rate \(460800\)"):
            port.configure()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"rate_hz": 2000}, "cannot be set to 2000 Hz; set rate_hz between 100 and 1000"),
        ({"rate_hz": 1000, "baud": 230_400}, "do not fit a line of 230400 baud; set rate_hz to at most 622"),
        ({"baud": 19_200}, "does not speak at 19200 baud; set baud to one of 9600, 57600, 115200, 230400, 460800"),
    ],
)
def test_what_a_sensone_cannot_do_is_refused_before_it_is_asked(
    line: Line, bota_sensor: WrenchSensor, change: dict[str, float], sentence: str
) -> None:
    with WrenchPort.open(bota_sensor.model_copy(update=change), line[0]) as port:
        with pytest.raises(InputError, match=sentence):
            port.configure()
        assert not select.select([line[1]], [], [], 0)[0], "a byte was sent"
