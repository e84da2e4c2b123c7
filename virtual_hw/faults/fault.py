"""What every fault has in common: where it lives, when it begins, how long it lasts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from config import InputError, Installation
from config.section import Name, Section

if TYPE_CHECKING:
    from virtual_hw.bus.local import LocalPort
    from virtual_hw.bus.socketcan import SocketCanPort
    from virtual_hw.bus.wire import Bus
    from virtual_hw.drive.node import DriveNode
    from virtual_hw.rig import Rig
    from virtual_hw.wrench import Sensor


@dataclass(frozen=True)
class Stage:
    """The stand-in's parts, for a fault to lay hands on."""

    installation: Installation
    rig: Rig
    ports: Sequence[LocalPort | SocketCanPort]
    sensors: Sequence[Sensor]

    def joint(self, name: str) -> int:
        """Number of the joint. Raises InputError for an unknown one."""
        return _number(name, self.installation.joint_names, "joint")

    def node(self, name: str) -> DriveNode:
        return self.rig.nodes[self.joint(name)]

    def bus(self, name: str) -> Bus:
        return self.rig.buses[_number(name, [bus.name for bus in self.installation.bus], "bus")]

    def port(self, bus: str) -> LocalPort | SocketCanPort:
        return self.ports[_number(bus, [b.name for b in self.installation.bus], "bus")]

    def sensor(self, name: str) -> Sensor:
        return self.sensors[_number(name, [s.name for s in self.installation.wrench_sensor], "wrench sensor")]


class Fault(Section):
    """One fault of a script. ``after``: ``start`` is power-on, ``enabled`` when every drive has been enabled,
    ``moving`` when a joint moves for the first time after that; then ``delay_ms`` go by. Without ``duration_ms`` it
    stays."""

    after: Literal["start", "enabled", "moving"] = "moving"
    delay_ms: float = 0.0
    duration_ms: float | None = None

    def check(self, stage: Stage) -> None:
        """Raises InputError when there is no such place in the installation."""

    def begin(self, stage: Stage) -> None:
        """The fault's first moment."""

    def tick(self, stage: Stage, now_ns: int) -> None:
        """Every servo tick while it lasts."""

    def end(self, stage: Stage) -> None:
        """Undo `begin`, as far as the real thing would be undone."""


class JointFault(Fault):
    joint: Name

    def check(self, stage: Stage) -> None:
        stage.joint(self.joint)


class BusFault(Fault):
    bus: Name

    def check(self, stage: Stage) -> None:
        stage.bus(self.bus)


class SensorFault(Fault):
    sensor: Name

    def check(self, stage: Stage) -> None:
        stage.sensor(self.sensor)


def _number(name: str, names: Sequence[str], what: str) -> int:
    if name not in names:
        known = ", ".join(names) or "none"
        raise InputError("faults", f"there is no {what} {name!r} in this installation", f"known are {known}")
    return list(names).index(name)
