"""Watches everything that must stop all axes: emergencies, lost feedback, heartbeats, buses, deadlines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from config import Installation
from driver.bus.errors import decode_error_frame
from driver.bus.frames import ERROR_FLAG, Frame
from driver.cia402.emergencies import decode_emergency
from driver.cia402.pdo_input import Reception
from driver.cia402.states import State, describe_statusword
from driver.cyclic.feedback import ArmFeedback

HEARTBEATS_MISSED = 3
"""A drive's heartbeat is lost after this many of its periods."""
EMERGENCY, HEARTBEAT = 0x080, 0x700
NODES = 0x7F
BOOT_UP, OPERATIONAL = 0x00, 0x05
COMMUNICATION_ERRORS = (0x8100, 0x8200)
"""Classes of emergencies after which a drive may not accept a fault reset before its communication is reset."""
NMT_WORDS = {0x04: "stopped", 0x7F: "pre-operational"}


@dataclass(slots=True)
class Findings:
    """What one cycle brought: sentences for /events, and of those the ones that must stop the arm."""

    events: list[str] = field(default_factory=list)
    causes: list[str] = field(default_factory=list)
    recommission: bool = False
    """A drive may have lost its configuration, or will not accept a fault reset without being set up anew."""


class Supervision:
    """Looks at each cycle's traffic and feedback; tells, and never acts."""

    def __init__(self, installation: Installation) -> None:
        self._names = installation.joint_names
        buses = [bus.name for bus in installation.bus]
        self._bus_names = buses
        self._joint_at = {(buses.index(j.bus), j.node_id): i for i, j in enumerate(installation.joint)}
        self._limit = installation.cycle.missed_deadlines_to_stop
        self._heartbeat_cycles = HEARTBEATS_MISSED * max(
            1, round(installation.cycle.heartbeat_ms * 1e-3 * installation.cycle.rate_hz)
        )
        self._cycle = 0
        self._heard_at = [0] * len(self._names)
        """Cycle of each drive's newest heartbeat."""
        self._late_in_a_row = 0
        self._missing: set[int] = set()
        self._faulted: set[int] = set()
        self._in_fault: dict[str, str] = {}

    def look(
        self,
        reception: Reception,
        feedback: ArmFeedback,
        bus_faults: Sequence[str],
        *,
        punctual: bool,
        commanding: bool,
    ) -> Findings:
        """Judge one cycle. ``punctual``: it began on time, and no cycle was skipped before it.

        ``commanding``: drives are enabled or becoming so; lateness and gaps harm nobody otherwise.
        """
        found = Findings()
        for sentence in bus_faults:
            found.events.append(sentence)
            found.causes.append(sentence)
            found.recommission = True
        self._cycle += 1
        if reception.other:
            self._other(reception, found)
        for bus, can_id, length in reception.malformed:
            found.events.append(
                f"{self._bus_names[bus]}: a PDO 0x{can_id:03X} of {length} bytes is not as mapped, ignored"
            )
        self._feedback(feedback, found, commanding=commanding)
        self._late_in_a_row = 0 if punctual or not commanding else self._late_in_a_row + 1
        if self._late_in_a_row >= self._limit:
            found.causes.append(f"{self._late_in_a_row} deadlines were missed in a row; the machine is too busy")
            self._late_in_a_row = 0
        return found

    def forget(self, in_fault: Mapping[str, str] | None = None) -> None:
        """Start anew, after a commissioning or a reset. ``in_fault``: joint → what its drive said of its fault when it
        was commissioned, whose emergency came before anybody listened."""
        self._in_fault = dict(in_fault or {})
        self._heard_at = [self._cycle] * len(self._names)
        self._late_in_a_row = 0
        self._missing.clear()
        self._faulted.clear()

    def _other(self, reception: Reception, found: Findings) -> None:
        for bus, can_id, data in reception.other:
            if can_id & ERROR_FLAG:
                error = decode_error_frame(Frame(can_id, data))
                found.events.append(f"{self._bus_names[bus]}: {error.words}")
                if error.bus_off or error.frames_lost:
                    found.causes.append(found.events[-1])
                    found.recommission |= error.bus_off
                continue
            joint = self._joint_at.get((bus, can_id & NODES))
            if joint is None:
                continue
            name = self._names[joint]
            if can_id & ~NODES == EMERGENCY and len(data) == 8:
                emergency = decode_emergency(can_id, data)
                found.events.append(f"{name}: {emergency}")
                if not emergency.reset:
                    found.causes.append(found.events[-1])
                    found.recommission |= emergency.code & 0xFF00 in COMMUNICATION_ERRORS
            elif can_id & ~NODES == HEARTBEAT:
                self._heard_at[joint] = self._cycle
                nmt = data[0] & 0x7F if data else -1
                if nmt == BOOT_UP:
                    found.causes.append(f"{name}: the drive has restarted and lost its configuration")
                    found.recommission = True
                elif nmt != OPERATIONAL:
                    found.causes.append(f"{name}: the drive has left operation ({NMT_WORDS.get(nmt, nmt)})")
                    found.recommission = True

    def _feedback(self, feedback: ArmFeedback, found: Findings, *, commanding: bool) -> None:
        overdue = self._cycle - self._heartbeat_cycles
        if feedback.unchanged and not self._missing and min(self._heard_at) > overdue:
            return
        for i, age in enumerate(feedback.age):
            if age or i in self._missing:
                self._gap(i, age, feedback, found, commanding=commanding)
            if self._heard_at[i] == overdue:
                found.causes.append(
                    f"{self._names[i]}: no heartbeat of the drive for {HEARTBEATS_MISSED} of its periods"
                )
                found.recommission = True
            state = feedback.states[i]
            if state is State.FAULT or state is State.FAULT_REACTION_ACTIVE:
                if i not in self._faulted:
                    self._faulted.add(i)
                    words = self._in_fault.pop(self._names[i], None) or describe_statusword(feedback.statuswords[i])
                    found.causes.append(f"{self._names[i]}: the drive reports {words}")
            elif state is not None and (self._faulted or self._in_fault):
                self._faulted.discard(i)
                self._in_fault.pop(self._names[i], None)

    def _gap(self, i: int, age: int, feedback: ArmFeedback, found: Findings, *, commanding: bool) -> None:
        name = self._names[i]
        if age and feedback.seen[i] and i not in self._missing:
            self._missing.add(i)
            found.events.append(f"{name}: feedback is missing")
        elif not age and i in self._missing:
            self._missing.discard(i)
            found.events.append(f"{name}: feedback is back")
        if age >= self._limit and commanding:
            found.causes.append(f"{name}: no feedback for {age} cycles")
            found.recommission = True
