"""Faults inside a drive: power stage, state machine, encoder, motor wiring, brake."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import PrivateAttr

from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.states import ENERGISED, PowerState
from virtual_hw.faults.fault import JointFault, Stage

State = Literal[
    "any", "SWITCH_ON_DISABLED", "READY_TO_SWITCH_ON", "SWITCHED_ON", "OPERATION_ENABLED", "QUICK_STOP_ACTIVE"
]


class DriveFault(JointFault):
    """The drive detects a fault of its own, with the emergency ``code`` (CiA 402-2), when it is in ``state``."""

    kind: Literal["drive_fault"]
    code: int
    state: State = "any"
    resets: bool = True
    """Whether a fault reset clears it while the fault lasts."""
    _struck: bool = PrivateAttr(default=False)

    def tick(self, stage: Stage, now_ns: int) -> None:
        axis = stage.node(self.joint).axis
        if not self._struck and (self.state == "any" or axis.state.name == self.state):
            self._struck = True
            axis.fault(self.code)
            axis.fault_stands = not self.resets

    def end(self, stage: Stage) -> None:
        stage.node(self.joint).axis.fault_stands = False


class SafeTorqueOff(JointFault):
    """The safety circuit takes the torque away: no fault, the drive merely finds itself switched off."""

    kind: Literal["safe_torque_off"]

    def tick(self, stage: Stage, now_ns: int) -> None:
        axis = stage.node(self.joint).axis
        if axis.state in ENERGISED or axis.state is not PowerState.SWITCH_ON_DISABLED:
            axis.cut_torque()


class ModeRefused(JointFault):
    """6060 takes no mode, although 6502 names it."""

    kind: Literal["mode_refused"]
    silently: bool = False
    """Accept the write and display another mode, in place of an abort."""

    def begin(self, stage: Stage) -> None:
        store = stage.node(self.joint).store
        if self.silently:
            store.effects[0x6060, 0] = lambda _: None
        else:
            store.guards[0x6060, 0] = _refuse


def _refuse(_value: int) -> None:
    raise SdoAbort(Abort.VALUE)


class AbortOptionSwapped(JointFault):
    """6007 with a vendor's own meaning: 3 disables the voltage and 2 is the quick stop."""

    kind: Literal["abort_option_swapped"]

    def begin(self, stage: Stage) -> None:
        stage.node(self.joint).axis.abort_options = {2: 3, 3: 2}


class Encoder(JointFault):
    """What the position sensor reports: ``jump`` by ``rad``, ``freeze``, ``wrap`` into a smaller register, a turned
    ``sign`` from here on."""

    kind: Literal["encoder"]
    how: Literal["jump", "freeze", "wrap", "sign"]
    rad: float = 0.5
    bits: int = 16
    _first: tuple[int, float] | None = PrivateAttr(default=None)
    _i: int = PrivateAttr(default=0)
    _counts: int = PrivateAttr(default=0)

    def begin(self, stage: Stage) -> None:
        stage.rig.sense_tampers.append(self._tamper)
        self._i = stage.joint(self.joint)
        turn = stage.installation.joint[self._i].encoder
        self._counts = round(turn.sign * self.rad * turn.counts_per_turn / math.tau)

    def end(self, stage: Stage) -> None:
        stage.rig.sense_tampers.remove(self._tamper)

    def _tamper(self, counts: list[int], speed: list[float]) -> None:
        i = self._i
        if self._first is None:
            self._first = counts[i], speed[i]
        if self.how == "jump":
            counts[i] += self._counts
        elif self.how == "freeze":
            counts[i], speed[i] = self._first[0], 0.0
        elif self.how == "wrap":
            half = 1 << self.bits - 1
            counts[i] = (counts[i] - self._first[0] + half - 64) % (2 * half) - half + 64 + self._first[0]
        else:
            counts[i], speed[i] = 2 * self._first[0] - counts[i], -speed[i]


class MotorTorque(JointFault):
    """The motor gives ``factor`` times the torque it is told and reports: −1 swapped phases, 0 a broken one."""

    kind: Literal["motor_torque"]
    factor: float
    _i: int = PrivateAttr(default=0)

    def begin(self, stage: Stage) -> None:
        self._i = stage.joint(self.joint)
        stage.rig.demand_tampers.append(self._tamper)

    def end(self, stage: Stage) -> None:
        stage.rig.demand_tampers.remove(self._tamper)

    def _tamper(self, torque: list[float], _brake: list[bool]) -> None:
        torque[self._i] *= self.factor


class Brake(JointFault):
    """The holding brake stays closed, or no longer holds."""

    kind: Literal["brake"]
    how: Literal["stuck", "open"] = "stuck"
    _i: int = PrivateAttr(default=0)

    def begin(self, stage: Stage) -> None:
        self._i = stage.joint(self.joint)
        stage.rig.demand_tampers.append(self._tamper)

    def end(self, stage: Stage) -> None:
        stage.rig.demand_tampers.remove(self._tamper)

    def _tamper(self, _torque: list[float], brake: list[bool]) -> None:
        brake[self._i] = self.how == "stuck"
