"""What every phase of the arm's state machine works with: the last command, the reference, the axes, the deadline."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from config import InputError, Installation
from config.schema import Mode
from driver.cia402.states import State
from driver.cyclic.axes import Axes
from driver.cyclic.controller import TorqueController
from driver.cyclic.cycle import LoopState
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.reference import Follow, Hold, Reference, cycles_in
from driver.gravity import RigidBody

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


class Commanding:
    """One phase at a time makes the command of each cycle; phases follow one another by `_set` and `_begin`."""

    def __init__(
        self, installation: Installation, mode: Mode, body: RigidBody, announce: Callable[[str], None]
    ) -> None:
        self.installation, self.mode, self.body = installation, mode, body
        self.state = LoopState.IDLE
        self.cause: str | None = None
        self.run: Run | None = None
        self.axes = Axes(installation.joint_names)
        n = len(installation.joint)
        self.feedback = ArmFeedback(n)
        self._announce = announce
        self._period_s = 1.0 / installation.cycle.rate_hz
        self._zeros = [0.0] * n
        self._q_d, self._tau, self._tau_ff = [0.0] * n, [0.0] * n, [0.0] * n
        self._reference: Reference = Hold(self._q_d, self._zeros, self._zeros, self._period_s)
        self._controller = self._plain_controller()
        self._playing = False
        self._sent_samples = 0
        self._cycles = self._deadline = 0
        self._answer: Answer | None = None
        self._phase: Callable[[], Command] = self._idle
        self.silent = False
        """Whether commands and heartbeats are withheld, so that drives which do not obey stop by themselves."""

    @property
    def q_d(self) -> list[float]:
        """Position last commanded, rad."""
        return list(self._q_d)

    def sent(self, command: Command) -> None:
        """Remember what really went to the drives."""
        self._q_d, self._tau, self._tau_ff = command.q_d, command.tau, command.tau_ff
        if self._playing and self.run is not None:
            self._sent_samples = self.run.follow.sample

    def _idle(self) -> Command:
        """Drives off: commands follow the measured position, so that nothing jumps when they are enabled."""
        return self._following(self.axes.words(self.feedback, State.SWITCH_ON_DISABLED))

    def _following(self, words: list[int]) -> Command:
        # With the drives off the brakes carry the load; whoever is enabled next begins with gravity's torque.
        q = list(self.feedback.q_known)
        gravity = self.body.gravity(q)
        return Command(words, q, self._zeros, gravity, gravity, None)

    def _controlled(self, words: list[int]) -> Command:
        """The reference's next sample through the controller."""
        desired = self._reference.next()
        fb = self.feedback
        tau, tau_ff = self._controller.torque(desired, fb.q, fb.dq, fb.valid, self._tau)
        return Command(words, desired.q, desired.dq, tau, tau_ff, self._controller.interval_s)

    def _frozen(self, words: list[int]) -> Command:
        return Command(words, self._q_d, self._zeros, self._tau, self._tau_ff, None)

    def _hold(self, q: Sequence[float]) -> None:
        """Hold ``q`` from now on, going over from the present feedforward to gravity."""
        self._reference = Hold(q, self._tau_ff, self.body.gravity(q), self._period_s)
        self._controller = self._plain_controller()

    def _plain_controller(self) -> TorqueController:
        return TorqueController(self.installation, self.mode, "pd+ff", self.installation.cycle.rate_hz, self.body)

    def _begin(self, state: LoopState, phase: Callable[[], Command], seconds: float, answer: Answer | None) -> None:
        self._answer = answer
        self._deadline = self._cycles + cycles_in(seconds, self.installation)
        self._set(state, phase)

    def _set(self, state: LoopState, phase: Callable[[], Command], news: str | None = None) -> None:
        if state is not self.state:
            self._announce(f"{state.name.lower()}" + (f" ({news})" if news else ""))
        self.state, self._phase = state, phase

    def _late(self) -> bool:
        """Whether the phase has taken longer than it may."""
        return self._cycles > self._deadline

    def _answered(self, problem: InputError | None) -> None:
        answer, self._answer = self._answer, None
        if answer is not None:
            answer(problem)
