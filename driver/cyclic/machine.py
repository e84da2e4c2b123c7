"""The state machine of the arm: from requests, feedback and faults to the command of each cycle.

It decides; the gate judges what it decided, and the loop sends it. Every way out of motion goes through `_stop`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from config import InputError, Installation
from config.schema import Mode
from driver.cia402.states import State
from driver.cyclic.axes import Axes
from driver.cyclic.controller import TorqueController
from driver.cyclic.cycle import LoopState
from driver.cyclic.damping import HANDOVER_SPEED_RAD_S, REST_SPEED_RAD_S, DampedStop, RestWatch
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.reference import BLEND_S, Desired, Follow, Hold, Reference, SlowDown, cycles_in
from driver.gravity import RigidBody
from driver.plan import Plan

ENABLE_S, DISABLE_S, POWER_OFF_S, STOP_S, CLEAR_S = 5.0, 3.0, 0.2, 2.0, 2.0
"""Longest time of each undertaking; then a sentence names the joint that did not follow."""
REST_HOLD_S = 0.2
"""After a stop the arm is held for this long before its brakes take over."""
START_TOLERANCE_RAD = 0.02
"""How far from where the arm holds a plan may begin; the difference is closed smoothly first."""
LEAD_IN_SHARE = 0.05
"""Share of the velocity limit that closing the difference may use."""
START_SPEED_SHARE = 0.02
"""Share of the velocity limit below which a plan begins and ends at rest."""

Answer = Callable[[InputError | None], None]


@dataclass(slots=True)
class Command:
    """What the loop sends at the end of a cycle; SI, one value a joint."""

    words: list[int]
    q_d: list[float]
    dq_d: list[float]
    tau: list[float]
    tau_ff: list[float]
    interval_s: float | None
    """Time that a step of torque may take (see `Gate.check`)."""


@dataclass(slots=True)
class Run:
    """The newest run: its number, the plan being followed, and how it ended."""

    number: int
    follow: Follow
    outcome: str | None = None


class ArmMachine:
    """States of `LoopState` for one commissioned mode. Call `step` once a cycle, then `sent` with what was sent."""

    def __init__(
        self, installation: Installation, mode: Mode, body: RigidBody, announce: Callable[[str], None]
    ) -> None:
        self.installation, self.mode, self.body = installation, mode, body
        self.state = LoopState.IDLE
        self.cause: str | None = None
        self.run: Run | None = None
        self.axes = Axes(installation.joint_names)
        self._announce = announce
        self._names = installation.joint_names
        self._period_s = 1.0 / installation.cycle.rate_hz
        n = len(self._names)
        self._zeros = [0.0] * n
        self._q_d, self._tau, self._tau_ff = [0.0] * n, [0.0] * n, [0.0] * n
        self._damped = DampedStop(installation, body)
        self._reference: Reference | None = None
        self._controller = self._plain_controller()
        self._playing = self._fresh = False
        self._deadline = 0
        self._cycles = 0
        self._answer: Answer | None = None
        self._next_controller = self._controller
        self._rest = RestWatch(installation)
        self._sent_samples = 0
        self._deadline_slack = cycles_in(POWER_OFF_S, installation)
        self.feedback = ArmFeedback(n)
        self._phase: Callable[[], Command] = self._idle

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
        place = f"plan {plan.name}"
        if plan.mode != self.mode:
            raise InputError(
                place, f"is for {plan.mode}, the drives are enabled in {self.mode}", "enable that mode first"
            )
        q, dq, _, tau_ff = plan.arrays
        lead_in_s = BLEND_S
        for i, joint in enumerate(self.installation.joint):
            off = abs(float(q[0, i]) - self._q_d[i])
            # The steepest slope of the smooth step is 1.5 over its length.
            lead_in_s = max(lead_in_s, 1.5 * off / (LEAD_IN_SHARE * joint.limits.velocity_rad_s))
            if off > START_TOLERANCE_RAD:
                raise InputError(
                    place,
                    f"{joint.name} begins at {q[0, i]:.4f} rad and the arm holds at {self._q_d[i]:.4f} rad",
                    "move to its start first",
                )
            speed = max(abs(float(dq[0, i])), abs(float(dq[-1, i])))
            if speed > START_SPEED_SHARE * joint.limits.velocity_rad_s:
                raise InputError(
                    place, f"{joint.name} has {speed:.3g} rad/s at its start or end", "begin and end at rest"
                )
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
        if answer is not None:
            self._answered(InputError("arm", f"stopped: {cause}"))
            self._answer = answer
        if self.state is LoopState.LATCHED:
            self._answered(None)
        self._stop(cause)

    def clear(self, answer: Answer) -> None:
        """Begin to reset the drives' faults; ``answer`` when none is left, or with the joint whose fault stays."""
        if self.state is LoopState.IDLE:
            answer(None)
            return
        self._require(LoopState.LATCHED, "reset", "stop it first")
        self._fresh = True
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
    def q_d(self) -> list[float]:
        """Position last commanded, rad."""
        return list(self._q_d)

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

    def quick_stop(self) -> Command:
        """The last resort: the drives stop by themselves, holding the last command that was sent."""
        self._set(LoopState.STOPPING, self._drive_side_stop)
        self._deadline = self._cycles + cycles_in(STOP_S, self.installation)
        return self._drive_side_stop()

    def sent(self, command: Command) -> None:
        """Remember what really went to the drives."""
        self._q_d, self._tau, self._tau_ff = command.q_d, command.tau, command.tau_ff
        if self._playing and self.run is not None:
            self._sent_samples = self.run.follow.sample

    # ── phases ──

    def _idle(self) -> Command:
        """Drives off: commands follow the measured position, so that nothing jumps when they are enabled."""
        return self._following(self.axes.words(self.feedback, State.SWITCH_ON_DISABLED))

    def _following(self, words: list[int]) -> Command:
        # With the drives off the brakes carry the load; whoever is enabled next begins with gravity's torque.
        q = list(self.feedback.q_known)
        gravity = self.body.gravity(q)
        return Command(words, q, self._zeros, gravity, gravity, None)

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
        if enabled and self._reference is not None and self._reference.done:
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
        if self._reference is not None and self._reference.done and self.run is not None:
            self._reference, self._controller = self.run.follow, self._next_controller
            self._playing, self._sent_samples = True, 0
            self._phase = self._play
        return self._follow_reference() if self._phase != self._play else self._play()

    def _play(self) -> Command:
        run = self.run
        if run is not None and run.follow.done:
            run.outcome = "done"
            self._playing = False
            rest = run.follow.plan.arrays[0][-1].tolist()
            self._hold(rest)
            self._set(LoopState.HOLDING, self._follow_reference, f"run {run.number} is done")
        return self._follow_reference()

    def _slow_down(self) -> Command:
        """CSP: along the path to rest, then hold."""
        if (
            self._reference is not None
            and self._reference.done
            and self._rest.at_rest(self.feedback.dq, self.feedback.valid)
        ):
            self._hold(self._q_d)
            self._rest_then_off()
        elif self._cycles > self._deadline:
            return self.quick_stop()
        return self._controlled(self._stopping_words(State.OPERATION_ENABLED))

    def _damp(self) -> Command:
        """CST: velocity damping over gravity to rest, then hold."""
        fb = self.feedback
        if self._rest.at_rest(fb.dq, fb.valid):
            self._hold(fb.q_known)
            self._rest_then_off()
            return self._phase()
        if self._cycles > self._deadline:
            return self.quick_stop()
        tau = self._damped.torque(fb.q_known, fb.dq, fb.valid, self._tau)
        # The feedforward recorded is what holds the arm at rest; the rest of the torque is damping.
        return Command(self._stopping_words(State.OPERATION_ENABLED), self._known(), self._zeros, tau, tau, None)

    def _rest_hold(self) -> Command:
        if self._cycles > self._deadline:
            self._begin(LoopState.STOPPING, self._switch_off, DISABLE_S, self._answer)
            return self._switch_off()
        return self._controlled(self._stopping_words(State.OPERATION_ENABLED))

    def _switch_off(self) -> Command:
        """Brakes first: the drives go to SWITCHED_ON while the arm is held, and lose their power when all have."""
        if not self.axes.any_torque(self.feedback):
            self._phase = self._power_off
            return self._power_off()
        if self._cycles > self._deadline:
            name = self.axes.first_with_torque(self.feedback)
            self._announce(f"{name} was not disabled in time; its power is cut")
            self._phase = self._power_off
            return self._power_off()
        return self._controlled(self._stopping_words(State.SWITCHED_ON))

    def _power_off(self) -> Command:
        if self.axes.all_off(self.feedback) or self._cycles > self._deadline + self._deadline_slack:
            self._off()
        return self._following(self.axes.words(self.feedback, State.SWITCH_ON_DISABLED))

    def _drive_side_stop(self) -> Command:
        if not self.axes.any_moving(self.feedback) or self._cycles > self._deadline:
            self._begin(LoopState.STOPPING, self._switch_off, DISABLE_S, self._answer)
            return self._frozen(self._stopping_words(State.SWITCH_ON_DISABLED))
        return self._frozen(self._stopping_words(State.QUICK_STOP_ACTIVE))

    def _clear(self) -> Command:
        words = self.axes.reset_words(self.feedback, begin=self._fresh)
        self._fresh = False
        if not self.axes.any_fault(self.feedback) and self.feedback.complete:
            self.cause = None
            self._set(LoopState.IDLE, self._idle, "reset")
            self._answered(None)
            return self._idle()
        if self.axes.cause is not None or self._cycles > self._deadline:
            self._phase = self._idle
            reason = self.axes.cause or "feedback is missing"
            self._answered(
                InputError("arm", f"the reset did not succeed: {reason}", "remove the cause and reset again")
            )
            return self._idle()
        return self._following(words)

    # ── parts of phases ──

    def _controlled(self, words: list[int]) -> Command:
        """The reference's next sample through the controller."""
        assert self._reference is not None
        desired: Desired = self._reference.next()
        fb = self.feedback
        tau, tau_ff = self._controller.torque(desired, fb.q, fb.dq, fb.valid, self._tau)
        return Command(words, desired.q, desired.dq, tau, tau_ff, self._controller.interval_s)

    def _frozen(self, words: list[int]) -> Command:
        return Command(words, self._q_d, self._zeros, self._tau, self._tau_ff, None)

    def _known(self) -> list[float]:
        return list(self.feedback.q_known)

    def _stopping_words(self, target: State) -> list[int]:
        return self.axes.stopping_words(self.feedback, target)

    def _hold(self, q: Sequence[float]) -> None:
        """Hold ``q`` from now on, going over from the present feedforward to gravity."""
        self._reference = Hold(q, self._tau_ff, self.body.gravity(q), self._period_s)
        self._controller = self._plain_controller()

    def _plain_controller(self) -> TorqueController:
        return TorqueController(self.installation, self.mode, "pd+ff", self.installation.cycle.rate_hz, self.body)

    def _rest_then_off(self) -> None:
        self._phase = self._rest_hold
        self._deadline = self._cycles + cycles_in(REST_HOLD_S, self.installation)

    def _stop(self, cause: str) -> None:
        """The one way to a stop: latch the cause, and bring all axes to rest by the best means there is."""
        if self.state is LoopState.STOPPING or self.state is LoopState.LATCHED:
            if self.cause is None:
                self.cause = cause
            return
        self.cause = cause
        powered = self.axes.any_torque(self.feedback) or self.state in (LoopState.HOLDING, LoopState.PLAYING)
        if self.run is not None and self.run.outcome is None:
            self.run.outcome = cause
        follow, self._playing = self.run.follow if self._playing and self.run else None, False
        if self.state is LoopState.ENABLING:
            self._answered(InputError("arm", f"could not be enabled: {cause}", "remove the cause, then reset"))
        self._deadline = self._cycles + cycles_in(STOP_S, self.installation)
        if not powered:
            self._set(LoopState.STOPPING, self._power_off, f"stopping: {cause}")
            return
        speed = HANDOVER_SPEED_RAD_S if self.mode == "cst" else REST_SPEED_RAD_S
        self._rest = RestWatch(self.installation, speed)
        self._set(LoopState.STOPPING, self._damp if self.mode == "cst" else self._slow_down, f"stopping: {cause}")
        if self.mode == "csp":
            if follow is not None:
                slow = SlowDown(follow.plan, self._sent_samples, self.installation, self._tau_ff)
                slow.rest_torque = self.body.gravity(self._q_d)
                self._reference = slow
            else:
                self._hold(self._q_d)

    def _off(self) -> None:
        """All drives are off: idle after a disable, latched after a stop."""
        if self.cause is None:
            self._set(LoopState.IDLE, self._idle)
        else:
            self._set(LoopState.LATCHED, self._idle, f"latched: {self.cause}")
        self._answered(None)

    def _begin(self, state: LoopState, phase: Callable[[], Command], seconds: float, answer: Answer | None) -> None:
        self._answer = answer
        self._deadline = self._cycles + cycles_in(seconds, self.installation)
        self._set(state, phase)

    def _set(self, state: LoopState, phase: Callable[[], Command], news: str | None = None) -> None:
        if state is not self.state:
            self._announce(f"{state.name.lower()}" + (f" ({news})" if news else ""))
        self.state, self._phase = state, phase

    def _held_up(self) -> bool:
        """Stop when an axis says why it does not come along, or enabling takes too long."""
        if self.axes.cause is None and self._cycles <= self._deadline:
            return False
        self._stop(self.axes.cause or f"the arm was not enabled within {ENABLE_S:g} s")
        return True

    def _answered(self, problem: InputError | None) -> None:
        answer, self._answer = self._answer, None
        if answer is not None:
            answer(problem)

    def _require(self, state: LoopState, verb: str, remedy: str) -> None:
        if self.state is not state or self._answer is not None:
            if self.state is LoopState.LATCHED and state is not LoopState.LATCHED:
                remedy = "acknowledge the cause with a reset first"
            why = f" ({self.cause})" if self.cause else ""
            raise InputError("arm", f"cannot {verb} while it is {self.state.name.lower()}{why}", remedy)
