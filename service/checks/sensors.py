"""Are the wrench sensors' lines there, ours to open, and quick?"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from config import Installation
from config.schema import WrenchSensor
from driver.wrench.port import port_path
from service.checks.finding import Finding

AREA = "sensor"
LONGEST_LATENCY_MS = 1


def check_sensors(installation: Installation) -> Iterator[Finding]:
    """Each sensor's serial line: present, permitted, and how long its USB adapter may hold bytes back."""
    for sensor in installation.wrench_sensor:
        path = port_path(sensor)
        if not path.exists():
            remedy = "start the stand-in arm" if sensor.port.startswith("pty:") else "plug it in, or correct port"
            yield Finding(AREA, sensor.name, "fail", f"{path} is not there", remedy)
        elif not os.access(path, os.R_OK | os.W_OK):
            yield Finding(
                AREA,
                sensor.name,
                "fail",
                f"this user may not use {path}",
                "join its group (dialout), or install the udev rule",
            )
        else:
            yield Finding(AREA, sensor.name, "ok", f"{sensor.protocol} on {path}, {sensor.rate_hz:g} Hz")
            yield from _latency(sensor, path)


def _latency(sensor: WrenchSensor, path: Path) -> Iterator[Finding]:
    """USB serial adapters by FTDI hand bytes over when their latency timer ends; 16 ms by default."""
    timer = Path("/sys/bus/usb-serial/devices", path.resolve().name, "latency_timer")
    if not timer.exists():
        return
    milliseconds = int(timer.read_text())
    subject = f"{sensor.name} latency"
    if milliseconds > LONGEST_LATENCY_MS:
        yield Finding(
            AREA,
            subject,
            "warn",
            f"the adapter holds bytes back for {milliseconds} ms",
            f"echo 1 > {timer}, or the udev rule",
        )
    else:
        yield Finding(AREA, subject, "ok", f"{milliseconds} ms")
