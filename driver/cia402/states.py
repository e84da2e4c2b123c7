"""The CiA 402 state machine: statusword to state, and the controlword that leads from one state towards another."""

from __future__ import annotations

from enum import Enum, IntFlag


class State(Enum):
    """States of the power drive system (IEC 61800-7-201, 402 "PDS FSA")."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP_ACTIVE = "quick stop active"
    FAULT_REACTION_ACTIVE = "fault reaction active"
    FAULT = "fault"

    @property
    def faulted(self) -> bool:
        return self in (State.FAULT, State.FAULT_REACTION_ACTIVE)

    @property
    def torque_possible(self) -> bool:
        """Whether the drive may be producing torque."""
        return self in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)


class Control(IntFlag):
    """Controlwords (object 6040) by the command they give; FAULT_RESET acts at its rising edge."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    ENABLE_OPERATION = 0x000F
    FAULT_RESET = 0x0080
    HALT = 0x0100


class Status(IntFlag):
    """Bits of the statusword (object 6041) beside the state."""

    VOLTAGE_ENABLED = 0x0010
    WARNING = 0x0080
    REMOTE = 0x0200
    TARGET_REACHED = 0x0400
    INTERNAL_LIMIT = 0x0800
    FOLLOWS_COMMAND = 0x1000
    """In the cyclic synchronous modes: the drive follows the command value."""
    FOLLOWING_ERROR = 0x2000


_PATTERNS = (
    (0x4F, 0x00, State.NOT_READY),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.OPERATION_ENABLED),
    (0x6F, 0x07, State.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, State.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, State.FAULT),
)


def _decode(low: int) -> State | None:
    return next((state for mask, value, state in _PATTERNS if low & mask == value), None)


_BY_LOW_BYTE: tuple[State | None, ...] = tuple(_decode(low) for low in range(256))


def state_of(statusword: int) -> State | None:
    """The state that a statusword shows; None for a pattern the standard does not define."""
    return _BY_LOW_BYTE[statusword & 0xFF]


_TOWARDS_ENABLED = {
    State.SWITCH_ON_DISABLED: Control.SHUTDOWN,
    State.READY: Control.SWITCH_ON,
    State.SWITCHED_ON: Control.ENABLE_OPERATION,
    State.OPERATION_ENABLED: Control.ENABLE_OPERATION,
    # Transition 16 is optional; by way of SWITCH_ON_DISABLED every drive can return to operation.
    State.QUICK_STOP_ACTIVE: Control.DISABLE_VOLTAGE,
}
_DOWN = {
    State.READY: {State.SWITCHED_ON: Control.SHUTDOWN, State.OPERATION_ENABLED: Control.SHUTDOWN},
    State.SWITCHED_ON: {State.OPERATION_ENABLED: Control.SWITCH_ON},
}
TARGETS = (
    State.SWITCH_ON_DISABLED,
    State.READY,
    State.SWITCHED_ON,
    State.OPERATION_ENABLED,
    State.QUICK_STOP_ACTIVE,
)
_HOLD = {
    State.SWITCH_ON_DISABLED: Control.DISABLE_VOLTAGE,
    State.READY: Control.SHUTDOWN,
    State.SWITCHED_ON: Control.SWITCH_ON,
    State.OPERATION_ENABLED: Control.ENABLE_OPERATION,
    State.QUICK_STOP_ACTIVE: Control.QUICK_STOP,
}


def controlword_towards(current: State, target: State) -> Control | None:
    """The controlword that takes the next step from ``current`` to ``target``, or holds the target once reached.

    None when no controlword leads there: a fault needs a reset first (`Axis` makes the edge), NOT_READY and
    FAULT_REACTION_ACTIVE end by themselves, and quick stop is entered from OPERATION_ENABLED only.
    Raises ValueError for a target that nobody can command.
    """
    if target not in TARGETS:
        raise ValueError(f"{target.value!r} cannot be commanded")
    if current in (State.FAULT, State.FAULT_REACTION_ACTIVE, State.NOT_READY):
        return None
    if current is target:
        return _HOLD[target]
    if target is State.SWITCH_ON_DISABLED:
        return Control.DISABLE_VOLTAGE
    if target is State.QUICK_STOP_ACTIVE:
        return Control.QUICK_STOP if current is State.OPERATION_ENABLED else None
    down = _DOWN.get(target, {}).get(current)
    return down if down is not None else _TOWARDS_ENABLED[current]


def path(current: State, target: State) -> tuple[tuple[Control, State], ...]:
    """All steps from ``current`` to ``target``: (controlword, state it leads to), by the standard's transitions.

    Raises ValueError when no controlword leads there.
    """
    steps: list[tuple[Control, State]] = []
    while current is not target:
        word = controlword_towards(current, target)
        if word is None:
            raise ValueError(f"no controlword leads from {current.value!r} to {target.value!r}")
        current = next_state(current, word)
        steps.append((word, current))
    return tuple(steps)


def next_state(current: State, controlword: int) -> State:
    """Where one controlword leads by the standard (transitions 2–12 and 16), quick-stop options 5–8 (staying) assumed.

    Fault reset (bit 7, transition 15) counts as a rising edge. Bits beyond 0–3 and 7 do not matter.
    The ramps of a drive that slows down first are left out: this is the state it comes to rest in.
    """
    if current is State.FAULT:
        return State.SWITCH_ON_DISABLED if controlword & 0x80 else State.FAULT
    if current in (State.NOT_READY, State.FAULT_REACTION_ACTIVE):
        return current
    if not controlword & 0x02:  # Disable voltage: transitions 7, 9, 10, 12.
        return State.SWITCH_ON_DISABLED
    if not controlword & 0x04:  # Quick stop: transitions 7, 10, 11.
        enabled = current in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
        return State.QUICK_STOP_ACTIVE if enabled else State.SWITCH_ON_DISABLED
    if not controlword & 0x01:  # Shutdown: transitions 2, 6, 8.
        return current if current is State.QUICK_STOP_ACTIVE else State.READY
    if current is State.READY:  # Switch on: transition 3, and enable operation on the way where bit 3 is set.
        return State.SWITCHED_ON
    if current is State.SWITCHED_ON:
        return State.OPERATION_ENABLED if controlword & 0x08 else State.SWITCHED_ON
    if current is State.OPERATION_ENABLED:
        return State.OPERATION_ENABLED if controlword & 0x08 else State.SWITCHED_ON
    if current is State.QUICK_STOP_ACTIVE and controlword & 0x08:
        return State.OPERATION_ENABLED
    return current


def describe_statusword(statusword: int) -> str:
    """A statusword for people: the state and the bits that matter."""
    state = state_of(statusword)
    words = [state.value if state else f"no state of the standard (0x{statusword:04X})"]
    if statusword & Status.WARNING:
        words.append("warning")
    if statusword & Status.INTERNAL_LIMIT:
        words.append("internal limit active")
    if statusword & Status.FOLLOWING_ERROR:
        words.append("following error")
    if state is State.OPERATION_ENABLED and not statusword & Status.FOLLOWS_COMMAND:
        words.append("not following the command")
    return ", ".join(words)
