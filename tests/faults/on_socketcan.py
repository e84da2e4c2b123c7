"""The fault matrix on SocketCAN: the same faults and bounds, and what only interfaces of a kernel can do.

Bounds in cycles hold in the guest's virtual time (tests/vcan/guest); on a clock that the machine's load reaches they
would measure that load.
"""

from __future__ import annotations

import os
import subprocess

from config import load_installation
from tests.faults.matrix import Seen, run
from tests.faults.scenarios import SCENARIOS, Scenario

IN_VIRTUAL_TIME = os.environ.get("VCAN_MODE") == "virtual"
DOWN = "interface went down"
_LOCAL_ONLY = "interface unplugged"


def _on_can1(kind: str, duration_ms: float | None = None) -> tuple[dict[str, object], ...]:
    return ({"kind": kind, "bus": "can1", "delay_ms": 100.0, "duration_ms": duration_ms},)


INTERFACE = [
    Scenario("CAN", "interface unplugged", _on_can1("unplugged"), "stops", DOWN, 2, resets=False),
    Scenario("CAN", "interface unplugged and back", _on_can1("unplugged", 50.0), "stops", DOWN, 2, resets=True),
    Scenario("CAN", "interface down", _on_can1("interface_down"), "stops", DOWN, 2, resets=False),
    Scenario("CAN", "interface down for 50 ms", _on_can1("interface_down", 50.0), "stops", DOWN, 2, resets=True),
    Scenario("CAN", "interface down, torque mode", _on_can1("interface_down"), "stops", DOWN, 2, "cst"),
]
ALL = [*(s for s in SCENARIOS if s.name != _LOCAL_ONLY), *INTERFACE]
PART = frozenset(
    {
        "one feedback frame lost", "feedback lost for 20 ms", "commands lost for good", "every frame doubled",
        "feedback 3 ms late", "commands too short", "drive's controller bus-off by bit errors",
        "host's controller bus-off, restarted", "babbling node", "cable cut for 30 ms",
        "SDO: no answer to one object", "SDO: abort 06090030", "mapping silently altered", "SYNC missing",
        "heartbeat lost", "spontaneous boot-up", "emergency storm", "fault in SWITCH_ON_DISABLED",
        "over-voltage in motion, torque mode", "safe torque off for a moment", "encoder jumps", "brake stuck",
        "wrong CRC", "unplugged and back", *(s.name for s in INTERFACE),
    }
)  # fmt: skip
"""Of each family some, for every `make test`; the whole is `make faults SOCKETCAN=1`."""


def _up(interface: str) -> None:
    if subprocess.run(["ip", "link", "show", interface], capture_output=True, check=False).returncode:
        subprocess.run(["ip", "link", "add", "dev", interface, "type", "vcan"], check=True)
    subprocess.run(["ip", "link", "set", interface, "up"], check=True)


def run_on_socketcan(scenario: Scenario) -> Seen:
    """One scenario on the direct drive arm with vcan0, vcan1 … for its buses, which are up before it and after it.

    An interface that the scenario takes down or away is so for nobody else.
    """
    dda = load_installation("dda")
    interfaces = [f"vcan{k}" for k in range(len(dda.bus))]
    for interface in interfaces:
        _up(interface)
    buses = (b.model_copy(update={"channel": f"socketcan:{i}"}) for b, i in zip(dda.bus, interfaces, strict=True))
    try:
        return run(dda.model_copy(update={"bus": tuple(buses)}), scenario)
    finally:
        for interface in interfaces:
            _up(interface)
