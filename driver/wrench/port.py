"""The serial line of a wrench sensor: opened, configured, read without ever waiting."""

from __future__ import annotations

import errno
import fcntl
import os
import select
import termios
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import serial

from config import InputError
from config.paths import run_directory
from config.schema import WrenchSensor
from driver.wrench import bota, robotiq

READ_BYTES = 4096
ANSWER_S = 1.0
QUIET_S = 0.08
"""A line without bytes for this long is silent: the time-out of Robotiq's own driver."""
T = TypeVar("T")


class SensorLost(OSError):
    """The line went away while it was in use: cable out, or the stand-in ended. The message is one sentence."""


class WrenchPort:
    """One open serial line. ``received`` counts every byte taken from it since it was opened."""

    def __init__(self, sensor: WrenchSensor, path: Path, line: serial.Serial, *, low_latency: bool) -> None:
        self.sensor = sensor
        self.path = path
        self.low_latency = low_latency
        """The driver was told not to collect bytes (an FTDI chip otherwise delivers every 16 ms)."""
        self.received = 0
        self.identity = ""
        """What the sensor said about itself when it was configured."""
        self._line = line
        self._fd: int = line.fileno()
        self._hang_up = select.poll()
        self._hang_up.register(self._fd, 0)

    @classmethod
    def open(cls, sensor: WrenchSensor, run_dir: Path | None = None) -> WrenchPort:
        """Open the sensor's line for this process alone. InputError: absent, no permission, in use, impossible baud."""
        path = port_path(sensor, run_dir)
        place = f"wrench sensor {sensor.name}"
        try:
            line = serial.Serial(str(path), sensor.baud, timeout=0, exclusive=True)
        except (serial.SerialException, OSError, ValueError) as error:
            raise InputError(place, *_refusal(error, path, sensor)) from None
        try:
            fcntl.ioctl(line.fileno(), termios.TIOCEXCL)
            settings = termios.tcgetattr(line.fileno())
            # Without this an empty line and one that was cut would both read as no bytes.
            settings[6][termios.VMIN] = 1
            termios.tcsetattr(line.fileno(), termios.TCSANOW, settings)
        except (OSError, termios.error) as error:
            line.close()
            raise InputError(place, f"{path} is not a serial line ({error.args[-1]})", "correct `port`") from None
        return cls(sensor, path, line, low_latency=_ask_low_latency(line))

    def fileno(self) -> int:
        return self._fd

    def read(self, limit: int = READ_BYTES) -> bytes:
        """All that has arrived, at most ``limit`` bytes; never waits. Raises `SensorLost`."""
        try:
            data = os.read(self._fd, limit)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._lost(error.strerror or str(error)) from None
        if not data:
            raise self._lost("hung up")
        self.received += len(data)
        return data

    def read_up_to(self, total: int, timeout_s: float) -> bytes:
        """Wait until the line has carried ``total`` bytes since it was opened, and return those not read yet.

        For lockstep, where the stand-in announces the total. Raises `SensorLost` when they do not come, and when
        none are to come because the line is gone.
        """
        if self.received >= total and self._hang_up.poll(0):
            raise self._lost("hung up")
        parts, deadline = list[bytes](), time.monotonic() + timeout_s
        while self.received < total:
            data = self.read(total - self.received)
            if data:
                parts.append(data)
                continue
            left = deadline - time.monotonic()
            if left <= 0:
                raise SensorLost(
                    f"wrench sensor {self.sensor.name}: {total - self.received} of the bytes announced did not come"
                )
            select.select([self._fd], [], [], left)
        return b"".join(parts)

    def configure(self) -> None:
        """Set rate and format and start the stream, each step acknowledged by the sensor.

        Raises InputError with what is wrong: silence, wrong baud rate, a refused command.
        """
        if self.sensor.protocol == "bota":
            self._configure_bota()
        else:
            self._configure_robotiq()

    def close(self) -> None:
        self._line.close()

    def __enter__(self) -> WrenchPort:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _configure_bota(self) -> None:
        for command, text in bota.configuration(self.sensor):

            def code(received: bytes, command: str = command) -> int | None:
                return bota.acknowledgement(command, received)

            answer = self._ask(text.encode() + b"\r\n", code, f"command {text!r}")
            if answer != 0:
                raise InputError(
                    f"wrench sensor {self.sensor.name}",
                    f"it refused the command {text!r} with code {answer}",
                    "compare rate_hz and baud with the sensor's manual",
                )

    def _configure_robotiq(self) -> None:
        self._write(robotiq.STOP_STREAM)
        self._drain_until_quiet()
        answers = []
        for register, count in ((robotiq.FIRMWARE, 3), (robotiq.SERIAL_NUMBER, 4)):

            def registers(received: bytes, count: int = count) -> bytes | None:
                return robotiq.read_answer(received, count)

            request = robotiq.read_request(register, count)
            answers.append(self._ask(request, registers, f"a read of register {register}"))
        self.identity = robotiq.identity(*answers)
        start = robotiq.write_request(robotiq.SELECT_OUTPUT, robotiq.STREAM)

        def started(received: bytes) -> bool | None:
            return robotiq.write_answered(received, robotiq.SELECT_OUTPUT) or None

        self._ask(start, started, "the start of its stream")

    def _ask(self, request: bytes, parse: Callable[[bytes], T | None], what: str) -> T:
        """Send, and wait for what ``parse`` finds in everything that comes back."""
        self._write(request)
        received, deadline = b"", time.monotonic() + ANSWER_S
        while (left := deadline - time.monotonic()) > 0:
            if select.select([self._fd], [], [], left)[0]:
                received += self._configuration_bytes()
                answer = parse(received)
                if answer is not None:
                    return answer
        raise InputError(f"wrench sensor {self.sensor.name}", *self._silence(received, what))

    def _silence(self, received: bytes, what: str) -> tuple[str, str]:
        if not received:
            return f"nothing on {self.path} answers {what}", "check cable and power, and that this is the right port"
        return (
            f"{len(received)} bytes came from {self.path} but no answer to {what}",
            f"check the baud rate ({self.sensor.baud}) and that this is a {self.sensor.protocol} sensor",
        )

    def _drain_until_quiet(self) -> None:
        deadline = time.monotonic() + ANSWER_S
        while time.monotonic() < deadline:
            if not select.select([self._fd], [], [], QUIET_S)[0]:
                return
            self._configuration_bytes()
        raise InputError(
            f"wrench sensor {self.sensor.name}",
            f"{self.path} does not stop sending",
            f"check that this is a {self.sensor.protocol} sensor at {self.sensor.baud} baud",
        )

    def _configuration_bytes(self) -> bytes:
        try:
            return self.read()
        except SensorLost as error:
            raise InputError(str(self.path), str(error), "plug it in and try again") from None

    def _write(self, data: bytes) -> None:
        sent, deadline = 0, time.monotonic() + ANSWER_S
        while sent < len(data):
            try:
                sent += os.write(self._fd, data[sent:])
            except BlockingIOError:
                if time.monotonic() > deadline:
                    raise InputError(
                        f"wrench sensor {self.sensor.name}",
                        f"{self.path} takes no more bytes",
                        "check that something is connected to it",
                    ) from None
                select.select([], [self._fd], [], ANSWER_S)
            except OSError as error:
                raise InputError(
                    str(self.path), str(self._lost(error.strerror or str(error))), "plug it in and try again"
                ) from None

    def _lost(self, why: str) -> SensorLost:
        return SensorLost(f"wrench sensor {self.sensor.name}: its line {self.path} is gone ({why})")


def port_path(sensor: WrenchSensor, run_dir: Path | None = None) -> Path:
    """The device file of ``port``; ``pty:<path>`` is relative to the run directory."""
    if not sensor.port.startswith("pty:"):
        return Path(sensor.port)
    return (run_dir or run_directory()) / sensor.port.removeprefix("pty:")


def _refusal(error: Exception, path: Path, sensor: WrenchSensor) -> tuple[str, str]:
    code = getattr(error, "errno", None)
    if code in (errno.ENOENT, errno.ENXIO, errno.ENODEV, errno.EIO):
        remedy = "start the stand-in first" if sensor.port.startswith("pty:") else "plug it in, or correct `port`"
        return f"there is no sensor at {path}", remedy
    if code in (errno.EACCES, errno.EPERM):
        return f"no permission to open {path}", "add this user to the group that owns it, usually dialout"
    # pyserial reports the lock of another process in words, without an error number of its own.
    if code in (errno.EBUSY, errno.EWOULDBLOCK) or "exclusively lock" in str(error):
        return f"another process has {path} open", "end it (fuser shows which)"
    return f"{path} cannot be opened at {sensor.baud} baud ({error})", "check `port` and `baud`"


def _ask_low_latency(line: serial.Serial) -> bool:
    try:
        line.set_low_latency_mode(True)
    except (OSError, ValueError):
        return False  # a pty, or a driver without latency timer
    return True
