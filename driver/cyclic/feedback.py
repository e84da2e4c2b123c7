"""The arm as the loop sees it in this cycle: what was measured, what is missing and for how long."""

from __future__ import annotations

from driver.cia402.pdo import Feedback
from driver.cia402.states import State, state_of


class ArmFeedback:
    """Feedback of all joints. Missing values are NaN in q, dq, tau; `q_known` remembers the newest angle, for gravity
    and for sentences only."""

    def __init__(self, joints: int) -> None:
        nan = float("nan")
        self.valid = [False] * joints
        self.q = [nan] * joints
        self.dq = [nan] * joints
        self.tau = [nan] * joints
        self.age = [0] * joints
        """Cycles since each joint's feedback arrived."""
        self.q_known = [0.0] * joints
        self.states: list[State | None] = [None] * joints
        """402 state by this cycle's statusword; None where it is missing or not of the standard."""
        self.statuswords = [-1] * joints
        self.seen = [False] * joints
        self.time_ns = 0
        self.complete = False
        """Whether every joint's feedback arrived in this cycle."""
        self.unchanged = False
        """Whether nothing but measurements differs from the cycle before: all joints heard of, the same statuswords."""

    def take(self, feedback: Feedback, time_ns: int) -> None:
        """Accept the feedback of the cycle that began at ``time_ns``."""
        self.time_ns = time_ns
        self.unchanged = self.complete and feedback.statusword == self.statuswords
        self.valid, self.q, self.dq, self.tau = feedback.valid, feedback.q, feedback.dq, feedback.tau
        if self.unchanged:
            self.q_known = feedback.q
            return
        self.statuswords = feedback.statusword
        self.q_known = list(self.q_known)
        states = self.states
        for i, ok in enumerate(feedback.valid):
            if ok:
                self.age[i] = 0
                self.seen[i] = True
                self.q_known[i] = feedback.q[i]
                states[i] = state_of(feedback.statusword[i])
            else:
                self.age[i] += 1
                states[i] = None
        self.complete = all(feedback.valid)
