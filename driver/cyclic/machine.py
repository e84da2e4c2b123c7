"""The state machine of the arm: from requests, feedback and faults to the command of each cycle.

It decides; the gate judges what it decided, and the loop sends it. Every way out of motion goes through `_stop`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from config import InputError, Installation
from config.schema import Mode
from driver.cia402.states import State
from driver.cyclic.commanding import Answer, Command, Run
from driver.cyclic.controller import TorqueController
from driver.cyclic.cycle import LoopState
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.plan_start import require_start
from driver.cyclic.reference import Follow, Hold
from driver.cyclic.stopping import DISABLE_S, Stopping
from driver.gravity import RigidBody
from driver.plan import Plan

ENABLE_S, CLEAR_S = 5.0, 2.0
"""Longest time of each undertaking; then a sentence names the joint that did not follow."""


class ArmMachine(Stopping):
    """States of `LoopState` for one commissioned mode. Call `step` once a cycle, then `sent` with what was sent."""

    def __init__(
        self, installation: Installation, mode: Mode, body: RigidBody, announce: Callable[[str], None]
    ) -> None:
        super().__init__(installation, mode, body, announce)
        self._next_controller = self._controller
        self._reset_begins = False

    # ── requests ──

    def enable(self, answer: Answer) -> None:
        """Begin to enable all drives; ``answer`` when the arm holds, or with what went wrong."""
        self._require(LoopState.IDLE, "enable", "disable or reset it first")
        self._begin(LoopState.ENABLING, self._switch_on, ENABLE_S, answer)

    def disable(self, answer: Answer) -> None:
        """Begin to disable all drives from holding; ``answer`` when all are off."""
        if self.state is LoopState.IDLE:
            answer(None)
            return
        self._require(LoopState.HOLDING, "disable", "wait for the end of the motion, or stop it")
        self._begin(LoopState.STOPPING, self._switch_off, DISABLE_S, answer)

    def play(self, plan: Plan, body: RigidBody, number: int) -> None:
        """Begin to play a checked plan; refused unless it begins where the arm holds and is at rest at its ends."""
        self._require(LoopState.HOLDING, "play", "enable it first")
        lead_in_s = require_start(plan, self.installation, self.mode, self._q_d)
        q, _, _, tau_ff = plan.arrays
        first = self._zeros if plan.controller == "pd" and plan.mode == "cst" else tau_ff[0].tolist()
        if plan.mode == "cst" and plan.controller == "computed_torque":
            first = body.gravity(q[0].tolist())
        self._reference = Hold(q[0].tolist(), self._tau_ff, first, self._period_s, self._q_d, lead_in_s)
        self.run = Run(number, Follow(plan))
        self._next_controller = TorqueController(
            self.installation, self.mode, plan.controller, plan.controller_rate_hz, body
        )
        self._set(LoopState.PLAYING, self._lead_in)

    def stop(self, cause: str, answer: Answer | None = None) -> None:
        """Stop all axes now; ``answer`` when the arm is at rest and its drives are off. The first cause is kept."""
        self._stop(cause)
        if answer is None:
            return
        if self.state is LoopState.LATCHED:
            answer(None)
            return
        self._answered(InputError("arm", f"stopped: {cause}"))
        self._answer = answer

    def clear(self, answer: Answer) -> None:
        """Begin to reset the drives' faults; ``answer`` when none is left, or with the joint whose fault stays."""
        if self.state is LoopState.IDLE:
            answer(None)
            return
        self._require(LoopState.LATCHED, "reset", "stop it first")
        self._reset_begins = True
        self._begin(LoopState.LATCHED, self._clear, CLEAR_S, answer)

    def latch(self, cause: str) -> None:
        """Latch a cause found with the drives off, without a cycle."""
        self.cause = cause
        self._set(LoopState.LATCHED, self._idle, f"latched: {cause}")

    def continue_from(self, before: ArmMachine) -> None:
        """Take over what outlives a commissioning: the newest run, and a latched cause until its reset."""
        self.run = before.run
        if before.state is LoopState.LATCHED:
            self.state, self.cause = LoopState.LATCHED, before.cause

    @property
    def busy(self) -> bool:
        """Whether something is under way that needs time to pass."""
        return self._answer is not None or self.state in (LoopState.ENABLING, LoopState.PLAYING, LoopState.STOPPING)

    @property
    def playing_run(self) -> int:
        """Number of the run whose samples are being commanded, else 0."""
        return self.run.number if self._playing and self.run is not None else 0

    # ── each cycle ──

    def step(self, feedback: ArmFeedback, causes: Sequence[str]) -> Command:
        """The command of this cycle. ``causes``: what must stop the arm, the first one counts."""
        self._cycles += 1
        self.feedback = feedback
        if causes:
            self._stop(causes[0])
        return self._phase()

    def refused(self, reason: str) -> Command:
        """The gate refused the command: stop the arm, and give the stop's command of the same cycle."""
        self._stop(f"command refused: {reason}")
        return self._phase()

    # ── phases ──

    def _switch_on(self) -> Command:
        if self.axes.all_in(self.feedback, State.SWITCHED_ON):
            # From here on the joints are held where they were in this very cycle.
            self._hold(self.feedback.q)
            self._phase = self._take_over
            return self._take_over()
        if self._held_up():
            return self._phase()
        return self._following(self.axes.words(self.feedback, State.SWITCHED_ON))

    def _take_over(self) -> Command:
        enabled = self.axes.all_in(self.feedback, State.OPERATION_ENABLED)
        if enabled and self._reference.done:
            self._set(LoopState.HOLDING, self._follow_reference)
            self._answered(None)
        elif self._held_up():
            return self._phase()
        return self._controlled(self.axes.words(self.feedback, State.OPERATION_ENABLED))

    def _follow_reference(self) -> Command:
        """Holding and playing: all drives must stay enabled."""
        words = self.axes.words(self.feedback, State.OPERATION_ENABLED)
        if self.axes.cause is not None:
            self._stop(self.axes.cause)
            return self._phase()
        return self._controlled(words)

    def _lead_in(self) -> Command:
        if self._reference.done and self.run is not None:
            self._reference, self._controller = self.run.follow, self._next_controller
            self._playing, self._sent_samples = True, 0
            self._phase = self._play
        return self._follow_reference()

    def _play(self) -> Command:
        run = self.run
        if run is not None and run.follow.done:
            run.outcome = "done"
            self._playing = False
            rest = run.follow.plan.arrays[0][-1].tolist()
            self._hold(rest)
            self._set(LoopState.HOLDING, self._follow_reference, f"run {run.number} is done")
        return self._follow_reference()

    def _clear(self) -> Command:
        words = self.axes.reset_words(self.feedback, begin=self._reset_begins)
        self._reset_begins = False
        if not self.axes.any_fault(self.feedback) and self.feedback.complete:
            self.cause = None
            self._distrusted.clear()
            self._set(LoopState.IDLE, self._idle, "reset")
            self._answered(None)
            return self._idle()
        if self.axes.cause is not None or self._late():
            self._phase = self._idle
            reason = self.axes.cause or "feedback is missing"
            self._answered(
                InputError("arm", f"the reset did not succeed: {reason}", "remove the cause and reset again")
            )
            return self._idle()
        return self._following(words)

    def _held_up(self) -> bool:
        """Stop when an axis says why it does not come along, or enabling takes too long."""
        if self.axes.cause is None and not self._late():
            return False
        self._stop(self.axes.cause or f"the arm was not enabled within {ENABLE_S:g} s")
        return True

    def _require(self, state: LoopState, verb: str, remedy: str) -> None:
        if self.state is not state or self._answer is not None:
            if self.state is LoopState.LATCHED and state is not LoopState.LATCHED:
                remedy = "acknowledge the cause with a reset first"
            why = f" ({self.cause})" if self.cause else ""
            raise InputError("arm", f"cannot {verb} while it is {self.state.name.lower()}{why}", remedy)
