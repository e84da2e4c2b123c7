"""From reference and feedback to the torque that is commanded."""

from __future__ import annotations

from collections.abc import Sequence

from config import Installation
from config.schema import Mode
from driver.cyclic.reference import Desired
from driver.gravity import RigidBody
from driver.plan import Controller


class TorqueController:
    """The controller of one phase of a motion.

    In CSP the servo is in the drive and the torque commanded is the feedforward alone (object 60B2, Appendix A's
    hybrid controllers). In CST, Appendix A's digital controllers, with gains from the configuration:

    - "pd": tau = K·(q_d − q) + D·(dq_d − dq)
    - "pd+ff": the same plus the reference's feedforward
    - "computed_torque": the same plus the rigid body's torque at the measured state, R̂⁻¹(q, dq, ddq_d)

    ``rate_hz`` below the loop's rate holds each torque until the controller's next instant. A joint whose feedback
    is missing keeps its last torque for that cycle: no torque is made from an old measurement.
    """

    def __init__(
        self,
        installation: Installation,
        mode: Mode,
        kind: Controller,
        rate_hz: float | None,
        body: RigidBody,
    ) -> None:
        self.mode = mode
        self.kind = kind
        self._body = body
        self._gains = [(j.digital.stiffness_nm_rad, j.digital.damping_nms_rad) for j in installation.joint]
        loop_hz = installation.cycle.rate_hz
        self._share = min(1.0, (rate_hz or installation.cycle.controller_rate_hz or loop_hz) / loop_hz)
        self._phase = 1.0 - self._share
        self.interval_s = 1.0 / (self._share * loop_hz)
        """Between two instants of the controller, on the mean."""
        self._tau: list[float] = []
        self._ff: list[float] = []

    def torque(
        self,
        desired: Desired,
        q: Sequence[float],
        dq: Sequence[float],
        valid: Sequence[bool],
        last_tau: Sequence[float],
    ) -> tuple[list[float], list[float]]:
        """(torque commanded, the feedforward in it), N·m a joint."""
        if self.mode == "csp":
            return desired.tau_ff, desired.tau_ff
        self._phase += self._share
        if self._phase < 1.0 - 1e-9:
            return self._tau, self._ff
        self._phase -= 1.0
        ff = self._feedforward(desired, q, dq, valid)
        q_d, dq_d = desired.q, desired.dq
        self._tau = [
            k * (q_d[i] - q[i]) + d * (dq_d[i] - dq[i]) + ff[i] if valid[i] else last_tau[i]
            for i, (k, d) in enumerate(self._gains)
        ]
        self._ff = ff
        return self._tau, ff

    def _feedforward(
        self, desired: Desired, q: Sequence[float], dq: Sequence[float], valid: Sequence[bool]
    ) -> list[float]:
        if self.kind == "pd":
            return [0.0] * len(q)
        if self.kind == "computed_torque":
            # One joint's missing angle would spoil every joint's torque: the reference stands in, for that cycle.
            state = [
                (a, b) if ok else (a_d, b_d)
                for a, b, ok, a_d, b_d in zip(q, dq, valid, desired.q, desired.dq, strict=True)
            ]
            return self._body.inverse_dynamics([a for a, _ in state], [b for _, b in state], desired.ddq)
        return desired.tau_ff
