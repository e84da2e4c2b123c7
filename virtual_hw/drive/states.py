"""The CiA 402 power drive state machine: states, commands, transitions."""

from __future__ import annotations

from enum import Enum, IntEnum


class PowerState(IntEnum):
    """States by their statusword pattern (bits 0–3, 5, 6)."""

    NOT_READY = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


class Command(Enum):
    """What bits 0–3 of the controlword ask for; fault reset is an edge and stands apart."""

    DISABLE_VOLTAGE = "disable voltage"
    QUICK_STOP = "quick stop"
    SHUTDOWN = "shutdown"
    SWITCH_ON = "switch on"
    """In operation enabled the same bits mean `disable operation`."""
    ENABLE_OPERATION = "enable operation"


FAULT_RESET = 0x80
HALT = 0x100

_DECODED = tuple(
    Command.DISABLE_VOLTAGE
    if not bits & 2
    else Command.QUICK_STOP
    if not bits & 4
    else Command.SHUTDOWN
    if not bits & 1
    else Command.ENABLE_OPERATION
    if bits & 8
    else Command.SWITCH_ON
    for bits in range(16)
)


def decode(controlword: int) -> Command:
    """The command in a controlword (CiA 402-2, table 'command coding')."""
    return _DECODED[controlword & 0xF]


_S, _C = PowerState, Command
DE_ENERGISED_TRANSITIONS: dict[tuple[PowerState, Command], PowerState] = {
    (_S.SWITCH_ON_DISABLED, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,  # 2
    (_S.READY_TO_SWITCH_ON, _C.SWITCH_ON): _S.SWITCHED_ON,  # 3
    (_S.READY_TO_SWITCH_ON, _C.ENABLE_OPERATION): _S.SWITCHED_ON,  # 3, then 4 by itself
    (_S.READY_TO_SWITCH_ON, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 7
    (_S.READY_TO_SWITCH_ON, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 7
    (_S.SWITCHED_ON, _C.ENABLE_OPERATION): _S.OPERATION_ENABLED,  # 4
    (_S.SWITCHED_ON, _C.SHUTDOWN): _S.READY_TO_SWITCH_ON,  # 6
    (_S.SWITCHED_ON, _C.QUICK_STOP): _S.SWITCH_ON_DISABLED,  # 10
    (_S.SWITCHED_ON, _C.DISABLE_VOLTAGE): _S.SWITCH_ON_DISABLED,  # 10
}
"""Transitions between states without torque; they need no stopping and happen at once."""

ENERGISED = frozenset({_S.OPERATION_ENABLED, _S.QUICK_STOP_ACTIVE, _S.FAULT_REACTION_ACTIVE})
"""States in which the power stage is on and the brake released."""
