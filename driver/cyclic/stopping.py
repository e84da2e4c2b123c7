"""The ways to rest: slowing down along the path, damping, the drives' quick stop; then holding, brakes, power off."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from config import InputError, Installation
from config.schema import Mode
from driver.cia402.states import Control, State
from driver.cyclic.commanding import Command, Commanding
from driver.cyclic.cycle import LoopState
from driver.cyclic.damping import HANDOVER_SPEED_RAD_S, REST_SPEED_RAD_S, DampedStop, RestWatch
from driver.cyclic.reference import SlowDown, cycles_in
from driver.gravity import RigidBody

DISABLE_S, POWER_OFF_S, STOP_S = 3.0, 0.2, 2.0
"""Longest time of each undertaking; then the next harder means is taken."""
REST_HOLD_S = 0.2
"""After a stop the arm is held for this long before its brakes take over."""


class Stopping(Commanding):
    """Phases from a stop's cause to drives that are off. Never zero torque first on a loaded joint."""

    def __init__(
        self, installation: Installation, mode: Mode, body: RigidBody, announce: Callable[[str], None]
    ) -> None:
        super().__init__(installation, mode, body, announce)
        self._damped = DampedStop(installation, body)
        self._rest = RestWatch(installation)
        self._distrusted: set[int] = set()

    def failed(self, reason: str) -> Command:
        """Nothing else can be sent: the drives stop by themselves, holding the last command that was sent."""
        self._stop(reason)
        return self._quick_stop()

    def distrust(self, joints: Iterable[int]) -> None:
        """While stopping, these joints are left to their brakes: a servo whose encoder or motor is wrong drives them
        away with all the torque it has."""
        self._distrusted.update(joints)

    def _stopping_words(self, target: State) -> list[int]:
        words = self.axes.stopping_words(self.feedback, target)
        for joint in self._distrusted:
            words[joint] = Control.DISABLE_VOLTAGE
        return words

    def _quick_stop(self) -> Command:
        self._begin(LoopState.STOPPING, self._drive_side_stop, STOP_S, self._answer)
        return self._drive_side_stop()

    def _slow_down(self) -> Command:
        """CSP: along the path to rest, then hold."""
        if self._reference.done and self._rest.at_rest(self.feedback.dq, self.feedback.valid):
            self._hold(self._q_d)
            self._rest_then_off()
        elif self._late():
            return self._quick_stop()
        return self._controlled(self._stopping_words(State.OPERATION_ENABLED))

    def _damp(self) -> Command:
        """CST: velocity damping over gravity to rest, then hold."""
        fb = self.feedback
        if self._rest.at_rest(fb.dq, fb.valid):
            self._hold(fb.q_known)
            self._rest_then_off()
            return self._phase()
        if self._late():
            return self._quick_stop()
        tau = self._damped.torque(fb.q_known, fb.dq, fb.valid, self._tau)
        # The feedforward recorded is what holds the arm at rest; the rest of the torque is damping.
        return Command(self._stopping_words(State.OPERATION_ENABLED), list(fb.q_known), self._zeros, tau, tau, None)

    def _rest_hold(self) -> Command:
        if self._late():
            self._begin(LoopState.STOPPING, self._switch_off, DISABLE_S, self._answer)
            return self._switch_off()
        return self._controlled(self._stopping_words(State.OPERATION_ENABLED))

    def _switch_off(self) -> Command:
        """Brakes first: the drives go to SWITCHED_ON while the arm is held, and lose their power when all have."""
        if self.axes.any_torque(self.feedback):
            if not self._late():
                return self._controlled(self._stopping_words(State.SWITCHED_ON))
            name = self.axes.first_with_torque(self.feedback)
            self._announce(f"{name} was not disabled in time; its power is cut")
        self._begin(LoopState.STOPPING, self._power_off, POWER_OFF_S, self._answer)
        return self._power_off()

    def _power_off(self) -> Command:
        if self.axes.all_off(self.feedback) or self._late():
            self._off()
            return self._idle()
        return self._frozen(self.axes.words(self.feedback, State.SWITCH_ON_DISABLED))

    def _drive_side_stop(self) -> Command:
        if self.axes.any_moving(self.feedback) and not self._late():
            return self._frozen(self._stopping_words(State.QUICK_STOP_ACTIVE))
        self._begin(LoopState.STOPPING, self._power_off, POWER_OFF_S, self._answer)
        return self._power_off()

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
        if not powered:
            self._begin(LoopState.STOPPING, self._power_off, POWER_OFF_S, self._answer)
            return
        self._deadline = self._cycles + cycles_in(STOP_S, self.installation)
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
        """All drives are off: idle after a disable, latched after a stop.

        One that is not heard of, or does not obey, may still have torque. What reaches it no more cannot stop it, but
        silence can: it misses the host's heartbeat and stops by its own means. The others are off.
        """
        disobeying = self.axes.first_not_off(self.feedback)
        if disobeying is not None and not self.silent:
            self.silent = True
            self.cause = self.cause or f"{disobeying} could not be switched off"
            self._announce(f"{disobeying} may still have torque: the host's heartbeat and commands are withheld")
        if self.cause is None:
            self._set(LoopState.IDLE, self._idle)
        else:
            self._set(LoopState.LATCHED, self._idle, f"latched: {self.cause}")
        self._answered(None)
