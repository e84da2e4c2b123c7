"""Faults of a whole bus: cable, controllers, strangers that talk too much."""

from __future__ import annotations

import os
import shutil
import subprocess
from typing import Literal

from pydantic import PrivateAttr

from config import InputError
from virtual_hw.bus.frames import error_frame, frame
from virtual_hw.bus.local import LocalPort
from virtual_hw.bus.socketcan import SocketCanPort
from virtual_hw.bus.wire import Bus, Controller
from virtual_hw.drive.node import DriveNode
from virtual_hw.faults.fault import BusFault, JointFault, Stage

_CONTROLLER, _BUS_OFF, _RESTARTED = 0x004, 0x040, 0x100
"""Classes of ``linux/can/error.h``."""
_TX_WARNING, _TX_PASSIVE = 0x08, 0x20
WARNING, PASSIVE, BUS_OFF = 96, 128, 256
"""Transmit error counts (ISO 11898-1, 8.3): warning, error-passive, bus-off."""


class CableCut(BusFault):
    """Host and drives part: nothing reaches the other side. What the host sends is acknowledged by nobody."""

    kind: Literal["cable_cut"]

    def begin(self, stage: Stage) -> None:
        stage.bus(self.bus).tampers.append(_nothing_passes)

    def end(self, stage: Stage) -> None:
        stage.bus(self.bus).tampers.remove(_nothing_passes)


def _nothing_passes(_bus: Bus, _raw: bytes, _sender: Controller) -> bool:
    return True


class StubCut(JointFault):
    """The cable to one drive is cut: it hears nothing and is not heard."""

    kind: Literal["stub_cut"]
    _controller: Controller | None = PrivateAttr(default=None)
    _by_others: bool = PrivateAttr(default=False)

    def begin(self, stage: Stage) -> None:
        node = stage.node(self.joint)
        self._controller = node.controller
        node.controller.deaf = True
        node.bus.tampers.append(self._tamper)

    def end(self, stage: Stage) -> None:
        node = stage.node(self.joint)
        node.controller.deaf = False
        node.bus.tampers.remove(self._tamper)

    def _tamper(self, _bus: Bus, _raw: bytes, sender: Controller) -> bool:
        return sender is self._controller


class BitErrors(JointFault):
    """Every frame of one drive is destroyed on the wire: it tries again until its controller goes bus-off.

    Each try costs eight counts and the time of the frame; a bus-off drive stays silent and deaf (no automatic recovery)
    until the fault ends.
    """

    kind: Literal["bit_errors"]
    _count: int = PrivateAttr(default=0)
    _controller: Controller | None = PrivateAttr(default=None)

    def begin(self, stage: Stage) -> None:
        stage.node(self.joint).bus.tampers.append(self._tamper)
        self._controller = stage.node(self.joint).controller

    def end(self, stage: Stage) -> None:
        node = stage.node(self.joint)
        node.bus.tampers.remove(self._tamper)
        node.controller.deaf = False
        self._count = 0

    def _tamper(self, bus: Bus, raw: bytes, sender: Controller) -> bool:
        if sender is not self._controller:
            return False
        if self._count < BUS_OFF:
            self._count += 8
            bus.send(sender, raw)
        if self._count >= BUS_OFF:
            sender.deaf = True
        return True


class HostBusOff(BusFault):
    """The host's own controller meets bit errors: warning, error-passive and bus-off are told by error frames, then
    nothing passes until the interface restarts (the end of the fault)."""

    kind: Literal["host_bus_off"]
    stop_at: Literal["warning", "passive", "bus_off"] = "bus_off"

    def begin(self, stage: Stage) -> None:
        self._tell(stage, error_frame(_CONTROLLER, bytes((0, _TX_WARNING, 0, 0, 0, 0, WARNING, 0))))
        if self.stop_at == "warning":
            return
        self._tell(stage, error_frame(_CONTROLLER, bytes((0, _TX_PASSIVE, 0, 0, 0, 0, PASSIVE, 0))))
        if self.stop_at == "passive":
            return
        self._tell(stage, error_frame(_BUS_OFF))
        stage.bus(self.bus).tampers.append(_nothing_passes)

    def end(self, stage: Stage) -> None:
        if self.stop_at == "bus_off":
            stage.bus(self.bus).tampers.remove(_nothing_passes)
            self._tell(stage, error_frame(_RESTARTED))

    def _tell(self, stage: Stage, message: bytes) -> None:
        stage.port(self.bus).tell_error(message)


class Unplugged(BusFault):
    """The host's interface goes away: its sockets on this bus are closed. A vcan is deleted, and made again when the
    fault ends; with it the stand-in loses the bus too."""

    kind: Literal["unplugged"]

    def check(self, stage: Stage) -> None:
        super().check(stage)
        _require_may_change(stage.port(self.bus))

    def begin(self, stage: Stage) -> None:
        port = stage.port(self.bus)
        if isinstance(port, LocalPort):
            for connection in port.connections:
                connection.alive = False
        else:
            _ip_link("delete", port.interface)

    def end(self, stage: Stage) -> None:
        port = stage.port(self.bus)
        if not isinstance(port, LocalPort):
            _ip_link("add", "dev", port.interface, "type", "vcan")
            _ip_link("set", port.interface, "up")


class InterfaceDown(BusFault):
    """The interface is taken down, as ``ip link set … down`` does; up again when the fault ends."""

    kind: Literal["interface_down"]

    def check(self, stage: Stage) -> None:
        super().check(stage)
        port = stage.port(self.bus)
        if isinstance(port, LocalPort):
            raise InputError("faults", f"{self.bus} is no interface of the kernel", "use unplugged, or a socketcan bus")
        _require_may_change(port)

    def begin(self, stage: Stage) -> None:
        self._set(stage, "down")

    def end(self, stage: Stage) -> None:
        self._set(stage, "up")

    def _set(self, stage: Stage, to: str) -> None:
        port = stage.port(self.bus)
        assert not isinstance(port, LocalPort)
        _ip_link("set", port.interface, to)


def _require_may_change(port: LocalPort | SocketCanPort) -> None:
    """Raises InputError for an interface that is none of ours to take away."""
    if isinstance(port, LocalPort):
        return
    if not port.interface.startswith("vcan"):
        raise InputError("faults", f"{port.interface} is no vcan", "pull its plug yourself")
    if os.geteuid() != 0 or shutil.which("ip") is None:
        raise InputError("faults", f"{port.interface} cannot be taken away", "run as root, with iproute2 installed")


def _ip_link(*arguments: str) -> None:
    subprocess.run(["ip", "link", *arguments], check=True)


class Babbling(BusFault):
    """A stranger talks without pause. ``can_id`` above all of ours only delays (a saturated bus), below all of ours it
    wins every arbitration (a babbling idiot)."""

    kind: Literal["babbling"]
    can_id: int = 0x7FF
    data: tuple[int, ...] = (0x55,) * 8
    _controller: Controller = PrivateAttr(default_factory=lambda: Controller(64))

    def tick(self, stage: Stage, now_ns: int) -> None:
        bus = stage.bus(self.bus)
        raw = frame(self.can_id, bytes(self.data))
        while self._controller.queued < self._controller.depth:
            bus.send(self._controller, raw)

    def end(self, stage: Stage) -> None:
        stage.bus(self.bus).detach(self._controller)


class TwinNode(JointFault):
    """A second drive with this drive's node id comes to the bus: it boots, answers SDO and listens to commands."""

    kind: Literal["twin_node"]
    _twin: DriveNode | None = PrivateAttr(default=None)

    def begin(self, stage: Stage) -> None:
        original = stage.node(self.joint)
        self._twin = DriveNode(
            original.joint, stage.installation.drive_of(original.joint), original.bus, stage.rig.tick_ns, _Idle()
        )

    def tick(self, stage: Stage, now_ns: int) -> None:
        if self._twin is not None:
            self._twin.tick(now_ns, 0, 0.0)

    def end(self, stage: Stage) -> None:
        if self._twin is not None:
            self._twin.controller.deaf = True
            self._twin = None


class _Idle:
    """A motor that nothing moves."""

    def torque_nm(self) -> float:
        return 0.0

    def currents_a(self) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0

    def temperature_c(self) -> float:
        return 20.0
