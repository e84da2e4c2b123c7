"""A drive on the bus: NMT, SDO, PDO, heartbeat and emergency around one axis."""

from __future__ import annotations

from enum import IntEnum
from functools import partial

from config.schema import Drive, Joint
from virtual_hw.bus.frames import frame
from virtual_hw.bus.wire import Bus, Controller, FrameHandler
from virtual_hw.drive.aborts import Abort, SdoAbort
from virtual_hw.drive.axis import Axis
from virtual_hw.drive.emergency import Emergencies, ErrorCode
from virtual_hw.drive.heartbeat import Heartbeats
from virtual_hw.drive.measured import MotorSenses, connect_measured
from virtual_hw.drive.objects import ObjectStore
from virtual_hw.drive.pdo import ReceivePdo, TransmitPdo
from virtual_hw.drive.pdo_rules import PdoRules
from virtual_hw.drive.sdo import SdoServer

QUEUE = 32
"""Transmit queue of a drive's controller, frames."""
_SAVE = int.from_bytes(b"save", "little")


class NmtState(IntEnum):
    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class DriveNode:
    """One node. `tick` is its firmware's servo tick; everything else happens on frames."""

    def __init__(self, joint: Joint, drive: Drive, bus: Bus, tick_ns: int, senses: MotorSenses) -> None:
        """
        Raises:
            InputError: the drive's EDS lacks an object that a CiA 402 drive needs.
        """
        self.joint, self.bus = joint, bus
        self.node_id = joint.node_id
        self.controller = Controller(QUEUE)
        self.nmt = NmtState.BOOT_UP
        self.store = ObjectStore(drive.eds, joint.node_id)
        connect_measured(self.store, joint, senses)
        self.store.preset(0x6076, 0, round(joint.rated_torque_nm / abs(joint.gear_ratio) * 1000))
        self.sdo = SdoServer(self.store)
        self.answer_sdo = self.sdo.answer
        """Bytes of an SDO request to those of its answer."""
        self._emergencies = Emergencies(self.store, self.send_emergency)
        self.axis = Axis(self.store, joint, tick_ns, self._emergencies)
        self._heartbeats = Heartbeats(self.store, bus, self.controller, self._send_heartbeat, self._heartbeat_lost)
        self._rpdos = [ReceivePdo(self.store, k, self._length_error) for k in range(4) if self.store.has(0x1400 + k, 1)]
        self._tpdos = [
            TransmitPdo(self.store, k, partial(bus.send, self.controller))
            for k in range(4)
            if self.store.has(0x1800 + k, 1)
        ]
        for pdo in (*self._rpdos, *self._tpdos):
            PdoRules(pdo, self._is_pre_operational, self._configure)
        for index in (0x1005, 0x1014):
            self.store.guards[index, 0] = self._guard_can_id
        self.store.effects[0x1005, 0] = lambda _: self._configure()
        self.store.guards[0x1010, 1] = self._guard_save
        self.store.effects[0x1010, 1] = lambda _: self._save()
        self._late = self._odd_sync = False
        self._heard: list[tuple[int, FrameHandler]] = []
        self.sync_rpdos: list[ReceivePdo] = []
        self.sync_tpdos: list[TransmitPdo] = []
        self._event_tpdos: list[TransmitPdo] = []
        self._timed_rpdos: list[ReceivePdo] = []
        bus.attach(self.controller)
        bus.listen(0x000, self.controller, self._on_nmt)
        self._boot()

    def tick(self, now_ns: int, counts: int, velocity: float) -> float:
        """One servo tick.

        Args:
            now_ns: time of the tick.
            counts: the encoder's counts.
            velocity: counts/s as sensed.

        Returns:
            Torque demand in the drive's direction, N·m at the joint.
        """
        torque = self.axis.tick(counts, velocity)
        if self._heartbeats.active:
            self._heartbeats.poll(now_ns)
        if self.nmt is NmtState.OPERATIONAL:
            for rpdo in self._timed_rpdos:
                if now_ns > rpdo.deadline_ns:
                    rpdo.deadline_ns = 1 << 63
                    self._late = True
                    self.axis.connection_lost(ErrorCode.RPDO_DEADLINE)
            for tpdo in self._event_tpdos:
                tpdo.poll(now_ns)
        return torque

    # --- NMT

    def _boot(self) -> None:
        self.nmt = NmtState.BOOT_UP
        self._send_heartbeat()
        self.nmt = NmtState.PRE_OPERATIONAL
        self._heartbeats.configure()
        self._configure()

    def _on_nmt(self, _now_ns: int, raw: bytes) -> None:
        if raw[4] != 2 or raw[9] not in (0, self.node_id):
            return
        command = raw[8]
        if command == 0x01:
            self.enter(NmtState.OPERATIONAL)
        elif command == 0x02:
            self._stopped()
        elif command == 0x80:
            self.enter(NmtState.PRE_OPERATIONAL)
        elif command in (0x81, 0x82):
            self.reset(0x0000 if command == 0x81 else 0x1000)

    def enter(self, state: NmtState) -> None:
        """Go to an NMT state, as after the host's command."""
        if state is self.nmt:
            return
        self.nmt = state
        self._configure()

    def _stopped(self) -> None:
        if self.nmt is not NmtState.STOPPED:
            self.enter(NmtState.STOPPED)
            self.axis.disconnect()

    def reset(self, low: int) -> None:
        """Reset node (all objects) or reset communication (1000h to 1FFFh); the power stage goes off with a node."""
        self.sdo.reset()
        if low == 0:
            self.store.reset()
            self._emergencies.reset()
            self.axis.power_on()
        else:
            self.store.reset(0x1000, 0x1FFF)
            self._emergencies.reset(communication=True)
            self.axis.disconnect()
        self._boot()

    def _is_pre_operational(self) -> bool:
        return self.nmt is NmtState.PRE_OPERATIONAL

    # --- reception

    def _configure(self) -> None:
        """Take up COB-IDs, mappings and NMT state: which identifiers are heard, which PDOs live."""
        for can_id, handler in self._heard:
            self.bus.ignore(can_id, self.controller, handler)
        self._heard = []
        values, slot = self.store.values, self.store.slot
        operational = self.nmt is NmtState.OPERATIONAL
        if self.nmt is not NmtState.STOPPED:
            self._listen(0x600 + self.node_id, self._on_sdo)
        rpdos = [pdo for pdo in self._rpdos if pdo.valid and operational]
        tpdos = [pdo for pdo in self._tpdos if pdo.valid and operational]
        for pdo in (*rpdos, *tpdos):
            pdo.configure()
        for rpdo in rpdos:
            self._listen(rpdo.can_id, self._receiver(rpdo))
        if operational:
            self._listen(values[slot(0x1005)] & 0x7FF, self.on_sync)
        self.sync_rpdos = [pdo for pdo in rpdos if pdo.synchronous]
        self._timed_rpdos = [pdo for pdo in rpdos if pdo.timeout_ns]
        self.sync_tpdos = [pdo for pdo in tpdos if pdo.synchronous]
        self._event_tpdos = [pdo for pdo in tpdos if pdo.event_driven]
        self.axis.motion.velocity_offset_mapped = any(0x60B1 in pdo.indices for pdo in rpdos)

    def _listen(self, can_id: int, handler: FrameHandler) -> None:
        self._heard.append((can_id, handler))
        self.bus.listen(can_id, self.controller, handler)

    def _receiver(self, rpdo: ReceivePdo) -> FrameHandler:
        def act(now_ns: int, raw: bytes) -> None:
            if rpdo.accept(now_ns, raw):
                if self._late:
                    self._in_time()
                if not rpdo.synchronous:
                    rpdo.apply()
                    self._commanded(rpdo)

        return act

    def on_sync(self, _now_ns: int, raw: bytes) -> None:
        """A SYNC has ended."""
        if raw[4]:
            self._emergencies.raise_error(ErrorCode.SYNC_LENGTH)
            self._odd_sync = True
            return
        if self._odd_sync:
            self._odd_sync = False
            self._emergencies.clear(ErrorCode.SYNC_LENGTH)
        for tpdo in self.sync_tpdos:
            tpdo.on_sync()
        self.act()

    def act(self) -> None:
        """At the SYNC: take up what synchronous RPDOs have brought."""
        for rpdo in self.sync_rpdos:
            if rpdo.pending is not None:
                rpdo.apply()
                self._commanded(rpdo)

    @property
    def regular(self) -> bool:
        """Whether a SYNC does nothing but send the TPDOs that are due and take up all RPDOs, and no frame as mapped is
        an error."""
        return (
            self.nmt is NmtState.OPERATIONAL
            and not (self._late or self._odd_sync or self._event_tpdos)
            and all(tpdo.transmission for tpdo in self.sync_tpdos)
            and all(rpdo.in_order for rpdo in self.sync_rpdos)
        )

    def _commanded(self, rpdo: ReceivePdo) -> None:
        self.axis.motion.new_setpoint()
        if 0x6040 in rpdo.indices:
            self.axis.new_command()
        if 0x6060 in rpdo.indices:
            self.axis.select_mode()

    def _on_sdo(self, _now_ns: int, raw: bytes) -> None:
        answer = self.answer_sdo(raw[8 : 8 + raw[4]])
        if answer is not None:
            self._send(frame(0x580 + self.node_id, answer))

    # --- errors

    def _length_error(self, difference: int) -> None:
        if difference:
            self._emergencies.raise_error(ErrorCode.PDO_TOO_SHORT if difference < 0 else ErrorCode.PDO_TOO_LONG)
        else:
            self._emergencies.clear(ErrorCode.PDO_TOO_SHORT, ErrorCode.PDO_TOO_LONG)

    def _in_time(self) -> None:
        """RPDOs come again: the missed deadline is no error any more, unless it has become a fault of the axis."""
        if not self.axis.faulty:
            self._emergencies.clear(ErrorCode.RPDO_DEADLINE)
        self._late = False

    def _heartbeat_lost(self, _node_id: int) -> None:
        self.axis.connection_lost(ErrorCode.HEARTBEAT_LOST)
        behaviour = self.store.values[self.store.slot(0x1029, 1)]
        if behaviour == 0 and self.nmt is NmtState.OPERATIONAL:
            self.enter(NmtState.PRE_OPERATIONAL)
        elif behaviour == 2:
            self.enter(NmtState.STOPPED)

    # --- transmission

    def _send(self, raw: bytes) -> None:
        self.bus.send(self.controller, raw)

    def _send_heartbeat(self) -> None:
        self._send(frame(0x700 + self.node_id, bytes((self.nmt,))))

    def send_emergency(self, data: bytes) -> None:
        """Put eight EMCY bytes on the bus, when the NMT state allows."""
        if self.nmt in (NmtState.OPERATIONAL, NmtState.PRE_OPERATIONAL):
            cob_id = self.store.values[self.store.slot(0x1014)]
            if not cob_id & 1 << 31:
                self._send(frame(cob_id & 0x7FF, data))

    # --- objects

    def _guard_can_id(self, value: int) -> None:
        if value & 0x2000_0000 or value & 0x7FF == 0:
            raise SdoAbort(Abort.VALUE)

    def _guard_save(self, value: int) -> None:
        if value != _SAVE:
            raise SdoAbort(Abort.CANNOT_STORE)

    def _save(self) -> None:
        self.store.values[self.store.slot(0x1010, 1)] = 1  # reads as: saves on command
        self.store.save()
