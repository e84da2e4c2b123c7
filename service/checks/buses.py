"""Are the buses there, and do the drives answer as who they should be?"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from pathlib import Path

from config import InputError, Installation
from config.paths import run_directory
from config.schema import Bus
from driver.bus.channel import open_channel
from driver.cia402.commission import inspect
from service.checks.finding import Finding
from service.daemon.client import DaemonClient
from service.outcomes import NoDaemon

AREA = "bus"


def check_buses(installation: Installation) -> Iterator[Finding]:
    """Each bus by opening it; bit rate of SocketCAN interfaces; each drive's identity, modes and rated torque.

    While a daemon serves the arm the drives are its own: it has commissioned them, and says how they are.
    """
    serving = _daemon_state(installation)
    reachable = True
    for bus in installation.bus:
        if bus.channel.startswith("socketcan:"):
            yield from _bit_rate(bus)
        try:
            with open_channel(bus.channel) as channel:
                time = "lockstep" if channel.lockstep else "wall clock"
            yield Finding(AREA, bus.name, "ok", f"{bus.channel} is there, {time}")
        except InputError as error:
            reachable = False
            yield Finding(AREA, bus.name, "fail", f"{error.place}: {error.problem}", error.remedy)
    if serving is not None:
        yield Finding(AREA, "drives", "ok", f"commissioned by the running daemon; the arm is {serving}")
        return
    if not reachable:
        return
    try:
        reports = inspect(installation)
    except InputError as error:
        yield Finding(AREA, "drives", "fail", f"{error.place}: {error.problem}", error.remedy)
        return
    for drive in reports:
        serial = "" if drive.serial_number is None else f", serial number {drive.serial_number}"
        yield Finding(
            AREA, drive.joint, "ok",
            f"node {drive.node_id} on {drive.bus}{serial}, rated {drive.rated_torque_nm:.4g} N·m, {drive.words}",
        )  # fmt: skip


def _daemon_state(installation: Installation) -> str | None:
    try:
        with DaemonClient(run_directory(), installation.arm.name, looks_only=True) as daemon:
            return str(daemon.call("status")["state"])
    except (NoDaemon, InputError):
        return None


def _bit_rate(bus: Bus) -> Iterator[Finding]:
    interface = bus.channel.partition(":")[2]
    if not Path("/sys/class/net", interface).exists():
        return  # opening the channel says so
    try:
        shown = subprocess.run(
            ["ip", "-details", "-json", "link", "show", interface],
            capture_output=True,
            text=True,
            check=True,
            timeout=5,
        )
        data = json.loads(shown.stdout)[0].get("linkinfo", {}).get("info_data", {})
    except (OSError, subprocess.SubprocessError, json.JSONDecodeError, IndexError) as error:
        yield Finding(AREA, f"{bus.name} bit rate", "warn", f"cannot be read ({error})", "install iproute2")
        return
    rate = data.get("bittiming", {}).get("bitrate")
    if rate is None:
        yield Finding(AREA, f"{bus.name} bit rate", "ok", f"{interface} is virtual and has none")
    elif rate != bus.bitrate:
        yield Finding(
            AREA, f"{bus.name} bit rate", "fail", f"{interface} runs at {rate} bit/s, configured are {bus.bitrate}",
            f"ip link set {interface} type can bitrate {bus.bitrate}",
        )  # fmt: skip
    else:
        yield Finding(AREA, f"{bus.name} bit rate", "ok", f"{rate} bit/s")
