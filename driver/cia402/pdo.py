"""The cyclic exchange as precompiled ``struct`` codecs: all RPDOs of a bus in one packing, TPDOs by table.

Everything the loop calls each cycle is in `PdoCodec`; lists have one entry a joint in the installation's order.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from config.schema import Drive, Installation, Joint, Mode
from driver.bus.frames import pack
from driver.cia402.mapping import COMMANDS, FEEDBACK, MODE_CODES, SYNCHRONOUS, PdoMap, pdo_maps
from driver.cia402.pdo_input import CODES, HEAD, BusInput, Reception
from driver.cia402.scaling import JointScale

_NAN = math.nan


class CommandNotRepresentable(Exception):
    """A command that the wire cannot carry; it is refused, never clipped. Names the joint, object and value."""


@dataclass(slots=True)
class Feedback:
    """What the drives measured this cycle. Where ``valid`` is False everything else is NaN (statusword -1)."""

    valid: list[bool]
    statusword: list[int]
    q: list[float]
    dq: list[float]
    tau: list[float]


@dataclass(slots=True)
class _Slope:
    """Velocity of one axis from its last two positions."""

    counts: int | None = None
    time_ns: int = 0
    value: float | None = None

    def counts_per_s(self, counts: int, time_ns: int) -> float | None:
        """None for the first position, and where time has not moved on since."""
        if time_ns != self.time_ns or self.counts is None:
            elapsed = time_ns - self.time_ns
            self.value = (counts - self.counts) * 1e9 / elapsed if self.counts is not None and elapsed > 0 else None
            self.counts, self.time_ns = counts, time_ns
        return self.value


class PdoCodec:
    """Codec of all drives of an installation in one mode.

    Raises config.InputError when a drive's layout does not carry what the loop needs.
    """

    def __init__(self, installation: Installation, mode: Mode) -> None:
        self.mode: Mode = mode
        self.joints = installation.joint
        self.scales = [JointScale.of(joint) for joint in installation.joint]
        self.maps: list[tuple[PdoMap, ...]] = [pdo_maps(j, installation.drive_of(j), mode) for j in self.joints]
        bus_names = [bus.name for bus in installation.bus]
        drives = [installation.drive_of(joint) for joint in self.joints]
        self._compile_feedback(bus_names, drives)
        self._outputs = [
            _BusOutput(
                [(i, self.joints[i], drives[i], self.maps[i], self.scales[i]) for i in self._joints_on(name)], mode
            )
            for name in bus_names
        ]

    def _joints_on(self, bus: str) -> list[int]:
        return [i for i, joint in enumerate(self.joints) if joint.bus == bus]

    # ── commands ──

    def encode(
        self, controlword: Sequence[int], q: Sequence[float], dq: Sequence[float], tau: Sequence[float]
    ) -> list[bytearray]:
        """The RPDOs of each bus, ready for `Channel.send`; the arrays are reused by the next call.

        ``q`` rad and ``dq`` rad/s are position target and velocity offset (CSP), ``tau`` N·m at the joint the
        torque offset (CSP) or target (CST). Values that a mode does not map are not looked at.
        Raises CommandNotRepresentable for NaN, infinity, and what the mapped integers cannot carry.
        """
        return [output.encode(controlword, q, dq, tau) for output in self._outputs]

    # ── feedback ──

    def _compile_feedback(self, bus_names: list[str], drives: list[Drive]) -> None:
        self._raw: list[int] = []
        self._places: dict[tuple[int, str], int] = {}
        self._inputs: list[BusInput] = []
        masks = [0] * len(self.joints)
        bit = 1
        for number, name in enumerate(bus_names):
            every = [(pdo, i) for i in self._joints_on(name) for pdo in self.maps[i] if not pdo.receive]
            # How warm a motor is does not steer anything: the recorder decodes it (`driver.cia402.temperatures`).
            tpdos = [(pdo, i) for pdo, i in every if pdo.transmission == SYNCHRONOUS]
            tpdos.sort(key=lambda entry: entry[0].cob_id)
            place = len(self._raw)
            self._inputs.append(BusInput(number, [(pdo, drives[i]) for pdo, i in tpdos], self._raw, bit))
            for pdo, i in tpdos:
                for quantity in pdo.names:
                    self._places[i, quantity] = place
                    place += 1
                masks[i] |= bit
                bit <<= 1
        self._all_fresh = bit - 1
        self._axes: list[tuple[int, int, int, int, float, float, float, float, int]] = []
        for i, scale in enumerate(self.scales):
            status, position, torque = (self._places[i, quantity] for quantity in FEEDBACK)
            velocity = self._places.get((i, "velocity"), -1)
            self._axes.append((status, position, velocity, torque, *scale.feedback, masks[i]))
        self._fresh = self._sync_ns = 0
        self._slopes: dict[int, _Slope] = {i: _Slope() for i, axis in enumerate(self._axes) if axis[2] < 0}
        self.reception = Reception()

    def begin_cycle(self, time_ns: int) -> None:
        """Forget the last cycle's feedback: what does not come again is invalid. ``time_ns`` is the SYNC's instant."""
        self._fresh = 0
        self._sync_ns = time_ns
        self.reception = Reception()

    @property
    def complete(self) -> bool:
        """Whether every TPDO of every drive has come since `begin_cycle`."""
        return self._fresh == self._all_fresh

    def receive_late(self, bus: int, frames: bytes) -> None:
        """Take frames that came too late for their cycle: all but feedback is as good as ever."""
        self._inputs[bus].receive_late(frames, self.reception)

    def receive(self, bus: int, buffer: bytearray | memoryview | bytes, end: int) -> None:
        """Take the frames ``buffer[:end]`` that `Channel.drain` filled on bus number ``bus``."""
        self._fresh = self._inputs[bus].receive(buffer, end, self._fresh, self.reception)

    def feedback(self) -> Feedback:
        """What has come since `begin_cycle`, in SI units at the joint; a joint is valid when all its TPDOs came.

        Where a drive's PDOs carry no velocity, ``dq`` is the mean since the last position that came, over the time
        between their SYNCs; such a joint is not valid before its second position.
        """
        raw, fresh, now_ns = self._raw, self._fresh, self._sync_ns
        slopes = self._slopes
        speeds: list[float | None] = [
            (raw[velocity] if velocity >= 0 else slopes[i].counts_per_s(raw[position], now_ns))
            if fresh & mask == mask
            else None
            for i, (_, position, velocity, _, _, _, _, _, mask) in enumerate(self._axes)
        ]
        if None in speeds:
            return self._partial_feedback(speeds)
        axes = self._axes
        return Feedback(
            [True] * len(axes),
            [raw[axis[0]] for axis in axes],
            [raw[position] * k + zero for _, position, _, _, k, zero, _, _, _ in axes],
            [speed * axis[6] for speed, axis in zip(speeds, axes, strict=True)],  # type: ignore[operator]
            [raw[axis[3]] * axis[7] for axis in axes],
        )

    def _partial_feedback(self, speeds: Sequence[float | None]) -> Feedback:
        """Feedback where some joints' ``speeds`` (counts/s) are missing, and with them all else of these joints."""
        raw, result = self._raw, Feedback([], [], [], [], [])
        for speed, (status, position, _, torque, k_q, zero, k_dq, k_tau, _) in zip(speeds, self._axes, strict=True):
            valid = speed is not None
            result.valid.append(valid)
            result.statusword.append(raw[status] if valid else -1)
            result.q.append(raw[position] * k_q + zero if valid else _NAN)
            result.dq.append(_NAN if speed is None else speed * k_dq)
            result.tau.append(raw[torque] * k_tau if valid else _NAN)
        return result

    def raw_value(self, joint: int, name: str) -> int:
        """Raw value of a mapped TPDO object of joint number ``joint`` as last received; KeyError when not mapped."""
        return self._raw[self._places[joint, name]]


class _BusOutput:
    """All RPDOs of one bus as one struct: headers and values are arguments of a single ``pack_into``."""

    def __init__(self, axes: list[tuple[int, Joint, Drive, tuple[PdoMap, ...], JointScale]], mode: Mode) -> None:
        fmt, self._arguments = "<", list[int]()
        self._axes: list[tuple[int, str, int, int, int, int, float, float, float, float]] = []
        for i, joint, drive, maps, scale in axes:
            slots = {"controlword": -1, "q": -1, "dq": -1, "tau": -1}
            for pdo in maps:
                if not pdo.receive:
                    continue
                fmt += HEAD + "".join(CODES[drive.object(name).type] for name in pdo.names) + f"{8 - pdo.length}x"
                self._arguments += [pdo.cob_id, pdo.length]
                for name in pdo.names:
                    quantity = COMMANDS[name]
                    if quantity == "mode":
                        self._arguments.append(MODE_CODES[mode])
                        continue
                    slots[quantity] = len(self._arguments)
                    self._arguments.append(0)
            self._axes.append(
                (i, joint.name, slots["controlword"], slots["q"], slots["dq"], slots["tau"], *scale.command)
            )
        self._struct = struct.Struct(fmt)
        self._buffer = bytearray(self._struct.size)

    def encode(
        self, controlword: Sequence[int], q: Sequence[float], dq: Sequence[float], tau: Sequence[float]
    ) -> bytearray:
        values = self._arguments
        try:
            for i, _, at_word, at_q, at_dq, at_tau, k_q, zero, k_dq, k_tau in self._axes:
                values[at_word] = controlword[i]
                if at_q >= 0:
                    values[at_q] = round((q[i] - zero) * k_q)
                if at_dq >= 0:
                    values[at_dq] = round(dq[i] * k_dq)
                if at_tau >= 0:
                    values[at_tau] = round(tau[i] * k_tau)
            self._struct.pack_into(self._buffer, 0, *values)
        except (struct.error, ValueError, OverflowError):
            raise CommandNotRepresentable(self._culprit(controlword, q, dq, tau)) from None
        return self._buffer

    def _culprit(
        self, controlword: Sequence[int], q: Sequence[float], dq: Sequence[float], tau: Sequence[float]
    ) -> str:
        for i, name, _, at_q, at_dq, at_tau, k_q, zero, k_dq, k_tau in self._axes:
            for at, values, offset, factor, bits, what in (
                (at_q, q, zero, k_q, 32, "position {:g} rad"),
                (at_dq, dq, 0.0, k_dq, 32, "velocity {:g} rad/s"),
                (at_tau, tau, 0.0, k_tau, 16, "torque {:g} N·m"),
            ):
                # Mapped objects of other widths than 402's own would only move this bound of the sentence.
                bound = 1 << (bits - 1)
                if at >= 0 and not -bound - 0.5 <= (values[i] - offset) * factor <= bound - 0.5:
                    return f"joint {name}: a {what.format(values[i])} cannot be sent to the drive"
            if not 0 <= controlword[i] <= 0xFFFF:
                return f"joint {name}: controlword {controlword[i]} is not 16 bits"
        return "a command does not fit the mapped objects"


SYNC = pack(0x080)
"""The SYNC frame (CiA 301; no counter)."""


def heartbeat(node_id: int, state: int = 0x05) -> bytes:
    """A heartbeat frame of a node: 05 operational, 7F pre-operational, 04 stopped."""
    return pack(0x700 + node_id, bytes((state,)))
