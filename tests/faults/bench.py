"""One arm in one process for a fault: the stand-in in a thread, the loop stepped by hand, all in virtual time.

On the local bus time is moved by the loop's ticks (lockstep). On SocketCAN both follow the clock, and virtual time is
the guest kernel's (tests/vcan/guest).
"""

from __future__ import annotations

import os
import socket
import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from config import InputError, Installation
from config.schema import Mode
from driver.cyclic.cycle import LoopState
from driver.cyclic.loop import CyclicLoop
from driver.cyclic.status import RealtimeReport
from driver.plan import Plan
from virtual_hw.bus.local import LocalPort
from virtual_hw.bus.socketcan import SocketCanPort
from virtual_hw.event_loop import serve
from virtual_hw.faults import FaultScript, Injector
from virtual_hw.faults.fault import Stage
from virtual_hw.hidden import load_hidden
from virtual_hw.lockstep import START_NS
from virtual_hw.plant import build_plant
from virtual_hw.rig import Rig
from virtual_hw.wrench import build_sensors

REST_TICKS = 50


@dataclass
class Published:
    """One cycle as the loop published it."""

    time_ns: int
    state: LoopState
    values: list[float]
    wrench: Any
    batches: Sequence[tuple[int, bool, int, bytes]]
    serial: Sequence[tuple[int, bytes]]
    events: list[str]


@dataclass
class Kept:
    """Stands in for the ring: keeps every cycle."""

    cycles: list[Published] = field(default_factory=list)

    def publish(self, _index: int, time_ns: int, _late: int, state: LoopState, _run: int, _valid: int,
                values: list[float], wrench: Any, batches: Any, serial: Any, events: list[str]) -> None:  # fmt: skip
        self.cycles.append(Published(time_ns, state, values, wrench, list(batches), list(serial), list(events)))

    def close(self) -> None:
        """Nothing to close."""


def in_lockstep(installation: Installation) -> bool:
    """Whether its buses are local ones."""
    return all(bus.channel.startswith("local:") for bus in installation.bus)


class StandIn:
    """The stand-in arm with faults, in a thread of this process."""

    def __init__(self, installation: Installation, faults: FaultScript, run_dir: Path, seed: int = 1) -> None:
        hidden = load_hidden(installation, None)
        plant = build_plant(installation, hidden, seed)
        self._plant = plant
        self._low = self._high = np.full(plant.n, np.nan)
        self._speeds: deque[float] = deque(maxlen=REST_TICKS)
        self.lockstep = in_lockstep(installation)
        # The rig's time is the recordings' in both, so that a fault's beginning is on the loop's scale.
        self.rig = Rig(installation, plant, START_NS if self.lockstep else time.time_ns())
        self._ports: list[LocalPort | SocketCanPort] = [
            LocalPort(run_dir / where, bus) if kind == "local" else SocketCanPort(where, bus)
            for bus, (kind, _, where) in zip(
                self.rig.buses, (declared.channel.partition(":") for declared in installation.bus), strict=True
            )
        ]
        self._sensors = build_sensors(installation, hidden, plant, seed, run_dir)
        self.rig.power_stage.connect(self._sensors)
        self.said: list[str] = []
        self.injector = Injector(faults, Stage(installation, self.rig, self._ports, self._sensors), self.said.append)
        self.rig.at_ticks.append(self._watch)
        self._wake, self._end = socket.socketpair()
        self._thread = threading.Thread(
            target=serve, args=(self.rig, self._ports, self._sensors, self._wake), kwargs={"lockstep": self.lockstep}
        )
        self._thread.start()

    def _watch(self, _now_ns: int) -> None:
        q, dq = self._plant.true_state()
        self._speeds.append(max(map(abs, dq)))
        if self.injector.begun:
            self._low, self._high = np.fmin(self._low, q), np.fmax(self._high, q)

    @property
    def travel_rad(self) -> float:
        """How far a joint truly moved since the last fault began, at most."""
        return float(np.max(self._high - self._low)) if self.injector.begun else 0.0

    @property
    def speed_rad_s(self) -> float:
        """Highest true speed of a joint within the last moments."""
        return max(self._speeds)

    def close(self) -> None:
        self._end.send(b"\0")
        self._thread.join(10)
        for part in (*self._ports, *self._sensors, self._wake, self._end):
            part.close()


class Bench:
    """A commissioned loop on the stand-in, and everything it has published."""

    def __init__(self, installation: Installation, stand_in: StandIn, loop: CyclicLoop, kept: Kept) -> None:
        self.installation, self.stand_in, self.loop, self.kept = installation, stand_in, loop, kept

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Cycle until it holds; False when it does not within that much virtual time."""
        for _ in range(round(seconds * self.installation.cycle.rate_hz)):
            if condition():
                return True
            if not self.loop.connected:
                return condition()
            self.loop.cycle()
        return condition()

    def enable(self, mode: Mode) -> InputError | None:
        """The problem, when the arm was not enabled."""
        answers: list[InputError | None] = []
        self.loop.enable(mode, answers.append, lambda _: None)
        self.until(lambda: bool(answers), 8.0)
        return answers[0] if answers else InputError("arm", "gave no answer")

    def enable_again(self, mode: Mode) -> InputError | None:
        """Off and on, from holding."""
        self.loop.machine.disable(lambda _: None)
        self.until(lambda: self.state is LoopState.IDLE, 8.0)
        try:
            return self.enable(mode)
        except InputError as problem:
            return problem

    def reset(self) -> InputError | None:
        answers: list[InputError | None] = []
        try:
            self.loop.reset(answers.append, lambda _: None)
        except InputError as problem:
            return problem
        self.until(lambda: bool(answers), 8.0)
        return answers[0] if answers else InputError("arm", "gave no answer")

    def play(self, by_rad: float, seconds: float, mode: Mode) -> None:
        """A fifth-order move of every joint towards the middle of its range; begins at the next cycle."""
        start = np.array(self.loop.status().q_d)
        middle = np.array([sum(joint.limits.position_rad) / 2 for joint in self.installation.joint])
        s = np.linspace(0.0, 1.0, round(seconds * self.installation.cycle.rate_hz))[:, None]
        by = by_rad * np.where(start < middle, 1.0, -1.0)
        self.loop.play(
            Plan(
                q=start + (10 * s**3 - 15 * s**4 + 6 * s**5) * by,
                dq=(30 * s**2 - 60 * s**3 + 30 * s**4) * by / seconds,
                ddq=(60 * s - 180 * s**2 + 120 * s**3) * by / seconds**2,
                mode=mode,
                controller="pd" if mode == "csp" else "computed_torque",
            )
        )

    @property
    def state(self) -> LoopState:
        return self.loop.machine.state


@contextmanager
def standing_in(installation: Installation, faults: Sequence[dict[str, Any]], run_dir: Path) -> Iterator[StandIn]:
    """The stand-in with these faults, in its own run directory."""
    script = FaultScript.model_validate({"fault": list(faults)})
    before = os.environ.get("ETUDE_RUN")
    os.environ["ETUDE_RUN"] = str(run_dir)
    stand_in = StandIn(installation, script, run_dir)
    try:
        yield stand_in
    finally:
        stand_in.close()
        if before is None:
            del os.environ["ETUDE_RUN"]
        else:
            os.environ["ETUDE_RUN"] = before


@contextmanager
def commissioned(installation: Installation, stand_in: StandIn) -> Iterator[Bench]:
    """The loop on it. Raises InputError as commissioning does."""
    kept = Kept()
    loop = CyclicLoop(
        installation,
        lockstep=stand_in.lockstep,
        ring=kept,  # type: ignore[arg-type]
        realtime=RealtimeReport("normal", False, 0, ()),
        progress=lambda _: None,
    )
    try:
        yield Bench(installation, stand_in, loop, kept)
    finally:
        loop.close()


COMMAND = struct.Struct("<I")


def decoded_commands(installation: Installation, bus: int, data: bytes) -> Iterator[tuple[int, str, float]]:
    """(joint, quantity, value) of every command to an enabled drive in frames of bus number ``bus``, decoded apart
    from the driver's codec.

    Quantities: ``position`` rad, ``torque`` N·m; of layouts with the controlword first.
    """
    name = installation.bus[bus].name
    joints = {0x200 + j.node_id: i for i, j in enumerate(installation.joint) if j.bus == name}
    for at in range(0, len(data), 16):
        (can_id,) = COMMAND.unpack_from(data, at)
        joint = joints.get(can_id)
        if joint is None or data[at + 8] & 0x0F != 0x0F:
            continue  # a controlword that does not enable: its targets move nothing
        j = installation.joint[joint]
        payload = data[at + 8 : at + 8 + data[at + 4]]
        torque = struct.unpack_from("<h", payload, len(payload) - 2)[0]
        yield joint, "torque", j.encoder.sign * torque * j.rated_torque_nm / 1000
        if len(payload) == 8:
            counts = struct.unpack_from("<i", payload, 2)[0]
            angle = j.encoder.sign * counts / j.encoder.counts_per_turn * 2 * np.pi + j.encoder.zero_rad
            yield joint, "position", angle


def commands_on_the_wire(
    installation: Installation, cycles: Sequence[Published]
) -> Iterator[tuple[int, int, str, float]]:
    """(time, joint, quantity, value) of every command that was sent to an enabled drive."""
    for cycle in cycles:
        for bus, sent, time_ns, data in cycle.batches:
            if sent:
                for command in decoded_commands(installation, bus, data):
                    yield time_ns, *command
