"""Brings every drive from whatever it was to "configured, read back, operational", without ever enabling torque."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from config.errors import InputError
from config.schema import Drive, Installation, Joint, Mode
from config.start_up import quantity, raw_value
from driver.cia402 import objects
from driver.cia402.emergencies import error_code_words
from driver.cia402.mapping import MODE_CODES, default_cob_id, pdo_maps
from driver.cia402.nodes import HEARTBEAT_ID, SYNC_ID, BusNodes, Nmt, NmtState, master_node_id, open_nodes
from driver.cia402.remap import remap
from driver.cia402.sdo import SdoObjects
from driver.cia402.states import State, describe_statusword, state_of

BOOT_TIMEOUT_S = 5.0
"""From a reset of the communication to the boot-up message."""
MODE_TIMEOUT_S = 1.0
HOST_HEARTBEATS_MISSED = 3
"""A drive takes the host for lost after this many of its heartbeat times."""
SILENCE_MS = 15
"""A host that has died must have stopped every drive within 20 ms, the drive's own tick and reaction included."""
RATED_TORQUE_TOLERANCE = 0.01
_LISTEN_S = 0.05

Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class DriveReport:
    """What a drive says of itself."""

    joint: str
    node_id: int
    bus: str
    serial_number: int | None
    revision: int | None
    rated_torque_nm: float
    """Of object 6076 through the gear, at the joint."""
    state: State | None
    words: str
    """State and, in a fault, the last error, for people."""


@dataclass(frozen=True, slots=True)
class Commissioned:
    """A commissioned arm: all drives are operational, configured for ``mode``, and not enabled by us."""

    mode: Mode
    master_node: int
    """Node id under which the host sends the heartbeat that the drives supervise from its first message on."""
    drives: tuple[DriveReport, ...]


@dataclass(frozen=True, slots=True)
class _Axis:
    joint: Joint
    drive: Drive
    nodes: BusNodes
    sdo: SdoObjects


def commission(
    installation: Installation, mode: Mode, *, run_dir: Path | None = None, progress: Progress | None = None
) -> Commissioned:
    """Configure all drives for ``mode``, also those that were set up for another one or have lost the connection.

    Nobody may be cycling on the buses meanwhile. No drive is enabled, and the supervision of the host's heartbeat
    starts with the first one it sends. Raises InputError, naming joint, node and object, at the first thing that
    is not as configured; drives are then left pre-operational, where PDOs do not move them.
    """
    say = progress or (lambda _: None)
    with open_nodes(installation, run_dir) as buses:
        axes = _axes(installation, buses)
        _refuse_strangers(installation, buses)
        for axis in axes:
            say(f"{axis.joint.name}: reset of the communication")
            _reset_communication(axis)
        for axis in axes:
            say(f"{axis.joint.name}: identity")
            check_identity(axis.sdo, axis.drive)
        for axis in axes:
            say(f"{axis.joint.name}: configuration for {mode}")
            _configure(axis, installation, mode)
        for axis in axes:
            say(f"{axis.joint.name}: operational")
            _start(axis, installation)
        return Commissioned(mode, master_node_id(installation), tuple(_report(axis) for axis in axes))


def inspect(installation: Installation, *, run_dir: Path | None = None) -> tuple[DriveReport, ...]:
    """Identity, modes and rated torque of every drive, compared with the configuration; nothing is written.

    Raises InputError like `commission`.
    """
    with open_nodes(installation, run_dir) as buses:
        axes = _axes(installation, buses)
        for axis in axes:
            check_identity(axis.sdo, axis.drive)
            for mode in installation.modes:
                _require_mode(axis.sdo, mode)
            _require_rated_torque(axis)
        return tuple(_report(axis) for axis in axes)


def deadline_ms(installation: Installation) -> int:
    """How long RPDOs may stay away before a drive reacts: soon, yet never after a few cycles only."""
    cycles = installation.cycle.missed_deadlines_to_stop + 2
    return max(SILENCE_MS, -(-cycles * installation.cycle.period_ns // 1_000_000))


def check_identity(sdo: SdoObjects, drive: Drive) -> None:
    """Compare 1000 and 1018 with the drive's file; raises InputError for another device."""
    wanted = drive.identity
    remedy = f"this is not the drive {drive.name}; correct the joint's drive or node_id"
    sdo.require(objects.DEVICE_TYPE, 0, wanted.device_type, remedy)
    sdo.require(objects.IDENTITY, 1, wanted.vendor_id, remedy)
    sdo.require(objects.IDENTITY, 2, wanted.product_code, remedy)
    if wanted.revision is not None:
        sdo.require(objects.IDENTITY, 3, wanted.revision, "another firmware; use its EDS and correct the drive file")


def _axes(installation: Installation, buses: Sequence[BusNodes]) -> list[_Axis]:
    by_name = {nodes.bus.name: nodes for nodes in buses}
    axes = []
    for joint in installation.joint:
        drive, nodes = installation.drive_of(joint), by_name[joint.bus]
        axes.append(_Axis(joint, drive, nodes, nodes.add(joint, drive)))
    return axes


def _refuse_strangers(installation: Installation, buses: Sequence[BusNodes]) -> None:
    """Two hosts on one arm would take turns at commanding it."""
    master = master_node_id(installation)
    for nodes in buses:
        if nodes.lockstep:
            continue  # Time stands still for the other host as well; the stand-in lets one host tick.
        rpdos = [default_cob_id(True, n, j.node_id) for j in installation.joints_on(nodes.bus) for n in (1, 2, 3, 4)]
        sent = nodes.strangers([SYNC_ID, HEARTBEAT_ID + master, *rpdos], _LISTEN_S)
        if sent:
            shown = ", ".join(f"0x{identifier:03X}" for identifier in sent)
            raise InputError(
                nodes.bus.channel, f"another host is commanding this bus (it sends {shown})", "stop it first"
            )


def _reset_communication(axis: _Axis) -> None:
    node_id = axis.joint.node_id
    axis.nodes.command(Nmt.RESET_COMMUNICATION, node_id)
    if not axis.nodes.wait_for(node_id, (NmtState.BOOT_UP,), BOOT_TIMEOUT_S):
        raise axis.sdo.error(
            f"no boot-up message came within {BOOT_TIMEOUT_S:g} s of a reset of the communication",
            "check supply, wiring, termination, node id and bit rate",
        )
    axis.nodes.command(Nmt.PRE_OPERATIONAL, node_id)


def _configure(axis: _Axis, installation: Installation, mode: Mode) -> None:
    sdo, joint, drive = axis.sdo, axis.joint, axis.drive
    _require_mode(sdo, mode)
    _require_rated_torque(axis)
    for write in drive.start_up:
        sdo.write_verified(write.index, write.subindex, raw_value(joint, write))
    _require_limits(sdo, joint)
    sdo.write_verified(objects.QUICK_STOP_OPTION, 0, drive.quick_stop_option)
    sdo.write_verified(objects.FAULT_REACTION_OPTION, 0, drive.fault_reaction_option)
    sdo.write_verified(objects.CONNECTION_LOST_OPTION, 0, drive.connection_lost_option)
    value, exponent = interpolation_period(installation.cycle.period_ns)
    sdo.write_verified(objects.INTERPOLATION_PERIOD, 1, value)
    sdo.write_verified(objects.INTERPOLATION_PERIOD, 2, exponent)
    if sdo.has(objects.SYNC_COB_ID):
        sdo.write_verified(objects.SYNC_COB_ID, 0, SYNC_ID)
    if sdo.has(objects.CYCLE_PERIOD_US):
        sdo.write_verified(objects.CYCLE_PERIOD_US, 0, round(installation.cycle.period_ns / 1000))
    remap(sdo, pdo_maps(joint, drive, mode), deadline_ms(installation))
    for offset in (objects.VELOCITY_OFFSET, objects.TORQUE_OFFSET):
        if sdo.has(offset):
            # An offset that the last mode left would be added to every command of this one.
            sdo.write_verified(offset, 0, 0)
    _select_mode(sdo, mode)
    heartbeat_ms = installation.cycle.heartbeat_ms
    sdo.write_verified(objects.PRODUCER_HEARTBEAT_MS, 0, heartbeat_ms)
    if not axis.nodes.lockstep and not axis.nodes.wait_for(joint.node_id, (NmtState.PRE_OPERATIONAL,), BOOT_TIMEOUT_S):
        raise sdo.error(f"it sends no heartbeat although 1017 is set to {heartbeat_ms} ms", "check its firmware")
    host = master_node_id(installation) << 16 | HOST_HEARTBEATS_MISSED * heartbeat_ms
    sdo.write_verified(objects.CONSUMER_HEARTBEAT, 1, host)


def _start(axis: _Axis, installation: Installation) -> None:
    node_id = axis.joint.node_id
    axis.nodes.command(Nmt.START, node_id)
    if not axis.nodes.lockstep and not axis.nodes.wait_for(node_id, (NmtState.OPERATIONAL,), BOOT_TIMEOUT_S):
        raise axis.sdo.error("it did not become operational", "look at its error history (object 1003)")


def _require_mode(sdo: SdoObjects, mode: Mode) -> None:
    supported = sdo.read(objects.SUPPORTED_MODES)
    if not supported >> (MODE_CODES[mode] - 1) & 1:
        name = sdo.name(objects.SUPPORTED_MODES)
        raise sdo.error(f"object {name} is 0x{supported:08X}: mode {mode} is not supported", "remove it from `modes`")


def _require_rated_torque(axis: _Axis) -> None:
    wanted, got = axis.joint.rated_torque_nm, _rated_torque_nm(axis)
    rounding = 0.5e-3 * abs(axis.joint.gear_ratio)
    if abs(got - wanted) > RATED_TORQUE_TOLERANCE * wanted + rounding:
        raise axis.sdo.error(
            f"object {axis.sdo.name(objects.RATED_TORQUE_MNM)} is {got:g} N·m through the gear, "
            f"the configuration says rated_torque_nm = {wanted:g}",
            "correct rated_torque_nm or gear_ratio",
        )


def _rated_torque_nm(axis: _Axis) -> float:
    return axis.sdo.read(objects.RATED_TORQUE_MNM) * 1e-3 * abs(axis.joint.gear_ratio)


def _require_limits(sdo: SdoObjects, joint: Joint) -> None:
    """Whatever the start-up writes were: the drive must not allow more than the joint's limits."""
    remedy = "let the drive's start_up write it from the joint's limits"
    for index, subindex, key, upper in (
        (objects.MAX_TORQUE, 0, "torque_limit", True),
        (objects.MAX_SPEED, 0, "velocity_limit", True),
        (objects.POSITION_LIMIT, 1, "position_low", False),
        (objects.POSITION_LIMIT, 2, "position_high", True),
    ):
        if not sdo.has(index, subindex):
            continue
        got, limit = sdo.read(index, subindex), quantity(joint, key)  # type: ignore[arg-type]
        if (got > limit + 1) if upper else (got < limit - 1):
            raise sdo.error(f"object {sdo.name(index, subindex)} is {got}, beyond the joint's {limit:.0f}", remedy)


def _select_mode(sdo: SdoObjects, mode: Mode) -> None:
    """6060, then 6061 until it shows the mode: some drives take a few servo ticks."""
    code = MODE_CODES[mode]
    sdo.write_verified(objects.MODE, 0, code)
    deadline = time.monotonic() + MODE_TIMEOUT_S
    while sdo.read(objects.MODE_DISPLAY) != code and time.monotonic() < deadline:
        time.sleep(0.01)
    sdo.require(objects.MODE_DISPLAY, 0, code, f"the drive does not take up mode {mode}; check its firmware")


def interpolation_period(period_ns: int) -> tuple[int, int]:
    """Object 60C2 for a cycle: (value 1–255, power of ten of a second).

    Raises InputError for a period that the object cannot say exactly.
    """
    for exponent in range(0, -10, -1):
        value, rest = divmod(period_ns, 10 ** (9 + exponent))
        if rest == 0 and 1 <= value <= 255:
            return value, exponent
    raise InputError(
        "cycle.rate_hz", f"a period of {period_ns * 1e-6:g} ms cannot be told to the drives (object 60C2)",
        "choose a rate whose period is 1 to 255 times a power of ten",
    )  # fmt: skip


def _report(axis: _Axis) -> DriveReport:
    sdo = axis.sdo
    statusword = sdo.read(objects.STATUSWORD)
    state, words = state_of(statusword), describe_statusword(statusword)
    if state is not None and state.faulted and sdo.has(objects.ERROR_CODE):
        code = sdo.read(objects.ERROR_CODE)
        words += f": {error_code_words(code)[0]} ({code:04X})"
    revision, serial = (sdo.read(objects.IDENTITY, sub) if sdo.has(objects.IDENTITY, sub) else None for sub in (3, 4))
    joint = axis.joint
    return DriveReport(joint.name, joint.node_id, joint.bus, serial, revision, _rated_torque_nm(axis), state, words)
