"""One axis through the 402 state machine, one step a cycle: from statusword to the next controlword, never waiting."""

from __future__ import annotations

from driver.cia402.states import Control, State, controlword_towards, describe_statusword, state_of

STEP_TIMEOUT_NS = 2_000_000_000
"""For one transition: charging a DC link or releasing a brake takes hundreds of milliseconds."""
QUICK_STOP_TIMEOUT_NS = 5_000_000_000
"""For leaving OPERATION_ENABLED while ramping down."""
RESET_PULSE_NS = 20_000_000
"""How long bit 7 stays at each level, so that its edge is seen at any cycle rate."""
RESET_TIMEOUT_NS = 1_000_000_000


class Axis:
    """The 402 sequencing of one joint's drive.

    Say what is wanted (`enable`, `disable`, `quick_stop`, `reset_fault`), call `step` every cycle, look at
    `state`, `reached` and `cause`. A cause is a sentence about why the axis does not do what is wanted; it stays
    until something new is asked for.
    """

    def __init__(self, joint: str) -> None:
        self.joint = joint
        self.state: State | None = None
        """As last seen; None before the first statusword and for patterns outside the standard."""
        self.target = State.SWITCH_ON_DISABLED
        self.cause: str | None = None
        self.controlword = int(Control.DISABLE_VOLTAGE)
        self._since_ns: int | None = None
        self._resetting_since_ns: int | None = None
        self._was_enabled = False

    @property
    def reached(self) -> bool:
        """Whether the drive is in the wanted state and nothing is under way."""
        return self.state is self.target and self._resetting_since_ns is None

    @property
    def settled(self) -> bool:
        """Whether the next step gives the same controlword as long as the statusword stays the same."""
        return self.reached and self.cause is None

    @property
    def enabled(self) -> bool:
        """Whether the drive follows commands now."""
        return self.state is State.OPERATION_ENABLED

    def enable(self) -> None:
        """Towards OPERATION_ENABLED. A drive in fault does not get there without `reset_fault`."""
        self._want(State.OPERATION_ENABLED)

    def switch_off(self) -> None:
        """Towards SWITCHED_ON: power stage on, no torque, brake closed; the gentle first step of disabling."""
        self._want(State.SWITCHED_ON)

    def disable(self) -> None:
        """Towards SWITCH_ON_DISABLED at once (disable voltage). The brake, where there is one, closes."""
        self._want(State.SWITCH_ON_DISABLED)

    def quick_stop(self) -> None:
        """The drive's own ramp (605A, 6085); a drive that is not enabled goes to SWITCH_ON_DISABLED instead."""
        self._want(State.QUICK_STOP_ACTIVE)

    def reset_fault(self) -> None:
        """A rising edge of bit 7, repeated until the drive has left FAULT; then SWITCH_ON_DISABLED."""
        self._want(State.SWITCH_ON_DISABLED)
        self._resetting_since_ns = -1

    def step(self, statusword: int | None, t_ns: int) -> int:
        """The controlword for this cycle.

        ``statusword`` is None (or negative) when no feedback came: the last controlword is repeated while the
        time-out runs. ``t_ns`` is any monotonic clock.
        """
        if statusword is not None and statusword >= 0:
            self._see(statusword, t_ns)
        if self._since_ns is None:
            self._since_ns = t_ns
        if self._resetting_since_ns is not None:
            self.controlword = int(self._reset(t_ns))
        elif self.state is not None:
            self.controlword = int(self._towards(self.state))
        self._watch(statusword, t_ns)
        return self.controlword

    def _want(self, target: State) -> None:
        if target is not self.target or self.cause is not None or self._resetting_since_ns is not None:
            self._since_ns = None
        self.target, self.cause, self._resetting_since_ns = target, None, None
        self._was_enabled = False

    def _see(self, statusword: int, t_ns: int) -> None:
        state = state_of(statusword)
        if state is not self.state:
            self.state, self._since_ns = state, t_ns
        if state is None:
            self.cause = f"joint {self.joint}: the drive reports {describe_statusword(statusword)}"
        elif state.faulted and self.target is not State.SWITCH_ON_DISABLED:
            self.cause = self.cause or f"joint {self.joint}: the drive is in {state.value}"
        elif self._was_enabled and not self.enabled and self.target is State.OPERATION_ENABLED:
            self.cause = self.cause or (
                f"joint {self.joint}: the drive left operation by itself and is in {state.value}"
            )
        if self.enabled and self.target is State.OPERATION_ENABLED:
            self._was_enabled = True

    def _towards(self, state: State) -> int:
        if self.target is State.OPERATION_ENABLED and self.cause is not None:
            # Whatever went wrong, an axis does not come back to operation unasked.
            return Control.DISABLE_VOLTAGE if not state.torque_possible else self.controlword
        word = controlword_towards(state, self.target)
        if word is None:
            stopping = self.target is State.QUICK_STOP_ACTIVE
            return Control.QUICK_STOP if stopping and not state.faulted else Control.DISABLE_VOLTAGE
        return word

    def _reset(self, t_ns: int) -> int:
        if self._resetting_since_ns == -1:
            self._resetting_since_ns = t_ns
        if self.state is not None and not self.state.faulted:
            self._resetting_since_ns = None
            return Control.DISABLE_VOLTAGE
        assert self._resetting_since_ns is not None
        elapsed = t_ns - self._resetting_since_ns
        if elapsed > RESET_TIMEOUT_NS:
            self._resetting_since_ns = None
            self.cause = (
                f"joint {self.joint}: the drive does not leave its fault on a fault reset; "
                "its cause is still there, or its communication must be reset"
            )
            return Control.DISABLE_VOLTAGE
        return Control.FAULT_RESET if elapsed // RESET_PULSE_NS % 2 else Control.DISABLE_VOLTAGE

    def _watch(self, statusword: int | None, t_ns: int) -> None:
        """Turn a transition that does not come about into a cause."""
        if self.cause is not None or self.reached or self._resetting_since_ns is not None or self._since_ns is None:
            return
        slow = self.target in (State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED) and (
            self.state is not None and self.state.torque_possible
        )
        limit = QUICK_STOP_TIMEOUT_NS if slow else STEP_TIMEOUT_NS
        if t_ns - self._since_ns <= limit:
            return
        if self.target in (State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED) and self.state in (
            State.SWITCH_ON_DISABLED,
            State.FAULT,
        ):
            return  # At rest without torque, which is all that was wanted.
        seen = "gives no feedback" if statusword is None or self.state is None else f"stays in {self.state.value}"
        self.cause = (
            f"joint {self.joint}: the drive {seen} for {limit / 1e9:g} s "
            f"instead of going to {self.target.value}; check its supply and enable input"
        )
