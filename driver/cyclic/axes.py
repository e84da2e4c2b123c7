"""The drives' 402 state machines, taken together: the controlword of every axis for what the arm shall do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from driver.cia402.states import Control, State, describe_statusword
from driver.cyclic.axis import Axis
from driver.cyclic.damping import REST_SPEED_RAD_S
from driver.cyclic.feedback import ArmFeedback

UNSEEN_CYCLES = 3
"""A drive not heard of for longer is taken for stopped by its own means."""


class Axes:
    """All axes of the arm, led to the same state."""

    def __init__(self, names: Sequence[str]) -> None:
        self._axes = tuple(Axis(name) for name in names)
        self._target = State.SWITCH_ON_DISABLED
        # Statuswords with which every axis is as wanted: the same again need no second look.
        self._settled_on: list[int] | None = None
        self._settled_words: list[int] = []

    def words(self, feedback: ArmFeedback, target: State) -> list[int]:
        """Each axis' next controlword towards ``target``; a word is kept while its axis is not heard of."""
        if target is not self._target:
            self._target, self._settled_on = target, None
            for axis in self._axes:
                _want(axis, target)
        return self._step(feedback)

    def stopping_words(self, feedback: ArmFeedback, target: State) -> list[int]:
        """As `words`, but an axis that left operation stays out of it, and one that is not heard of is told to stop
        by itself: what it does otherwise cannot be seen."""
        words = self.words(feedback, target)
        for i, state in enumerate(feedback.states):
            unseen = state is None and feedback.age[i] > UNSEEN_CYCLES
            if unseen or (state is State.QUICK_STOP_ACTIVE and target is State.OPERATION_ENABLED):
                words[i] = Control.QUICK_STOP
        return words

    def reset_words(self, feedback: ArmFeedback, *, begin: bool) -> list[int]:
        """Fault resets for the axes in fault; the others stay off."""
        if begin:
            self._target, self._settled_on = State.SWITCH_ON_DISABLED, None
            for axis in self._axes:
                axis.reset_fault()
        return self._step(feedback)

    @property
    def cause(self) -> str | None:
        """Why an axis does not do what is wanted, for the first that does not."""
        return next((axis.cause for axis in self._axes if axis.cause is not None), None)

    def all_in(self, feedback: ArmFeedback, target: State) -> bool:
        """Whether every axis was heard of in this cycle and is in ``target``."""
        return all(state is target for state in feedback.states)

    def all_off(self, feedback: ArmFeedback) -> bool:
        """Whether every axis that is heard of has no power, or is in fault."""
        return all(
            state in (State.SWITCH_ON_DISABLED, State.FAULT)
            for i, state in enumerate(feedback.states)
            if state is not None or feedback.age[i] <= UNSEEN_CYCLES
        )

    def first_not_off(self, feedback: ArmFeedback) -> str | None:
        """An axis that cannot be seen to be off."""
        for axis, state in zip(self._axes, feedback.states, strict=True):
            if state is None or state.torque_possible:
                return axis.joint
        return None

    def any_torque(self, feedback: ArmFeedback) -> bool:
        """Whether any drive may still produce torque; one that was not heard of for a moment counts."""
        return any(True for _ in self._with_torque(feedback))

    def first_with_torque(self, feedback: ArmFeedback) -> str:
        return next(self._with_torque(feedback), "no axis")

    def any_moving(self, feedback: ArmFeedback) -> bool:
        """Whether a drive-side stop is still under way on an axis that can be seen."""
        return any(
            state.torque_possible and (state is not State.QUICK_STOP_ACTIVE or abs(feedback.dq[i]) > REST_SPEED_RAD_S)
            for i, state in enumerate(feedback.states)
            if state is not None
        )

    def any_fault(self, feedback: ArmFeedback) -> bool:
        return any(state is not None and state.faulted for state in feedback.states)

    def in_words(self, feedback: ArmFeedback) -> tuple[str, ...]:
        """Each axis' state for people."""
        return tuple(
            describe_statusword(word) if ok else "not heard of"
            for word, ok in zip(feedback.statuswords, feedback.valid, strict=True)
        )

    def _step(self, feedback: ArmFeedback) -> list[int]:
        if feedback.statuswords == self._settled_on:
            return list(self._settled_words)
        now = feedback.time_ns
        words = [axis.step(word, now) for axis, word in zip(self._axes, feedback.statuswords, strict=True)]
        if all(axis.settled for axis in self._axes):
            self._settled_on, self._settled_words = list(feedback.statuswords), words
        return list(words)

    def _with_torque(self, feedback: ArmFeedback) -> Iterator[str]:
        for i, state in enumerate(feedback.states):
            unseen = state is None and feedback.seen[i] and feedback.age[i] <= UNSEEN_CYCLES
            if unseen or (state is not None and state.torque_possible):
                yield self._axes[i].joint


def _want(axis: Axis, target: State) -> None:
    if target is State.OPERATION_ENABLED:
        axis.enable()
    elif target is State.SWITCHED_ON:
        axis.switch_off()
    elif target is State.QUICK_STOP_ACTIVE:
        axis.quick_stop()
    else:
        axis.disable()
