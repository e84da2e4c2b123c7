"""Faults of a drive's CANopen: SDO, identity, mapping, NMT, emergencies."""

from __future__ import annotations

import struct
from abc import abstractmethod
from collections import deque
from typing import Literal

from pydantic import PrivateAttr

from virtual_hw.drive.node import NmtState
from virtual_hw.drive.sdo import SdoServer
from virtual_hw.faults.fault import JointFault, Stage

_ABORT = struct.Struct("<BHBI")
_ABORTED = b"\x80"


class _SdoFault(JointFault):
    """``index`` 0 means every object."""

    index: int = 0
    _server: SdoServer | None = PrivateAttr(default=None)

    def begin(self, stage: Stage) -> None:
        node = stage.node(self.joint)
        self._server = node.sdo
        node.answer_sdo = self._answer

    def end(self, stage: Stage) -> None:
        assert self._server is not None
        stage.node(self.joint).answer_sdo = self._server.answer

    def _concerns(self, request: bytes) -> bool:
        return not self.index or (len(request) == 8 and int.from_bytes(request[1:3], "little") == self.index)

    @abstractmethod
    def _answer(self, request: bytes) -> bytes | None:
        """What the drive sends in answer to a request; None for nothing."""

    def _real(self, request: bytes) -> bytes | None:
        assert self._server is not None
        return self._server.answer(request)


class SdoSilent(_SdoFault):
    """No answer at all."""

    kind: Literal["sdo_silent"]

    def _answer(self, request: bytes) -> bytes | None:
        return None if self._concerns(request) else self._real(request)


class SdoAborted(_SdoFault):
    """Refused with ``code`` (CiA 301, table 22, or a vendor's own)."""

    kind: Literal["sdo_abort"]
    code: int
    writes_only: bool = False

    def _answer(self, request: bytes) -> bytes | None:
        download = len(request) == 8 and request[0] >> 5 == 1
        if not self._concerns(request) or (self.writes_only and not download):
            return self._real(request)
        return _ABORT.pack(0x80, int.from_bytes(request[1:3], "little"), request[3], self.code)


class SdoLate(_SdoFault):
    """Each answer comes only with the second request after its own: by then the host has given up on it and on its
    retry. That the host aborts a transfer hurries nothing."""

    kind: Literal["sdo_late"]
    _held: deque[bytes | None] = PrivateAttr(default_factory=deque)

    def _answer(self, request: bytes) -> bytes | None:
        if request[:1] == _ABORTED:
            return None
        if not self._concerns(request) and not self._held:
            return self._real(request)
        self._held.append(self._real(request))
        return self._held.popleft() if len(self._held) > 2 else None


class SdoOtherObject(_SdoFault):
    """The answer names another object than was asked for."""

    kind: Literal["sdo_other_object"]

    def _answer(self, request: bytes) -> bytes | None:
        answer = self._real(request)
        if answer is None or not self._concerns(request):
            return answer
        return answer[:1] + struct.pack("<H", int.from_bytes(answer[1:3], "little") ^ 0x0001) + answer[3:]


class ObjectAltered(JointFault):
    """An object has another value than it should: an identity, an option, a limit. ``sticks``: writes to it are
    accepted and change nothing; else it is merely preset. Also after a reset of the communication."""

    kind: Literal["object_altered"]
    index: int
    subindex: int = 0
    value: int
    sticks: bool = False

    def begin(self, stage: Stage) -> None:
        store = stage.node(self.joint).store
        store.preset(self.index, self.subindex, self.value)
        if self.sticks:
            slot, key = store.slot(self.index, self.subindex), (self.index, self.subindex)
            effect = store.effects.get(key)

            def keep(_written: int) -> None:
                store.values[slot] = self.value
                if effect is not None:
                    effect(self.value)

            store.effects[key] = keep


class SpontaneousBoot(JointFault):
    """The drive restarts: its supply dipped."""

    kind: Literal["boot_up"]

    def begin(self, stage: Stage) -> None:
        stage.node(self.joint).reset(0x0000)


class NmtDrop(JointFault):
    """The drive leaves operational by itself."""

    kind: Literal["nmt_drop"]
    to: Literal["pre_operational", "stopped"] = "pre_operational"

    def begin(self, stage: Stage) -> None:
        stage.node(self.joint).enter(NmtState.PRE_OPERATIONAL if self.to == "pre_operational" else NmtState.STOPPED)


class EmergencyStorm(JointFault):
    """Emergencies as fast as the bus takes them, of changing codes, while the drive goes on."""

    kind: Literal["emergency_storm"]
    first_code: int = 0xFF00
    _number: int = PrivateAttr(default=0)

    def tick(self, stage: Stage, now_ns: int) -> None:
        node = stage.node(self.joint)
        for _ in range(4):
            code = self.first_code + self._number % 0x40
            self._number += 1
            node.send_emergency(struct.pack("<HB5x", code, 0x81))
