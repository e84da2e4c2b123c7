"""From a motion's name to what is practised: the reference with rests around it, the servo, the limits, the timing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import Installation
from config.motion import Motion, check_motion, load_motion, sample
from config.schema import Mode
from driver.plan import Plan
from learner.constrained import TorqueLimits
from learner.feedback_loop import FeedbackLoop
from learner.trial import Reference, Timing

Array = NDArray[np.float64]
REST_BEFORE_S, REST_AFTER_S = 0.15, 0.3
"""Played as part of the motion, so that what settles after it is learnt with it."""
UNKNOWN_DELAY_S = 1e-3
"""Of what is measured: a motor's and a sensor's own lag, of which no file tells."""
INERTIA_TOLERANCE = 0.1
"""Share by which an identified inertia matrix may be off without anybody's fault."""


@dataclass(frozen=True)
class Practised:
    """One motion of one installation in one mode, ready to be practised."""

    name: str
    installation: Installation
    mode: Mode
    reference: Reference
    loop: FeedbackLoop
    timing: Timing
    limits: TorqueLimits

    def plan(self, command: Array, name: str | None = None) -> Plan:
        """What the loop plays with this feedforward (samples × joints, N·m). Raises InputError beyond a limit."""
        reference = self.reference
        plan = Plan(reference.q, reference.dq, reference.ddq, command, self.mode, "pd+ff", name=name or self.name)
        plan.check(self.installation)
        return plan

    @property
    def velocity_measured(self) -> NDArray[np.bool_]:
        """(n,): whether a joint's drive sends a velocity of its own."""
        layouts = [self.installation.drive_of(joint).layouts[self.mode] for joint in self.installation.joint]
        return np.array([any("velocity" in pdo for pdo in layout.tpdo) for layout in layouts])

    @property
    def count_rad(self) -> Array:
        """(n,) rad that a count of each joint's encoder is."""
        return np.array([2.0 * np.pi / joint.encoder.counts_per_turn for joint in self.installation.joint])

    @property
    def command_delay(self) -> int:
        """Cycles from a reference's sample to the cycle in which the drive has reached it (nominal)."""
        return command_delay(self.mode)


def command_delay(mode: Mode) -> int:
    """Cycles by which what is measured is behind what was commanded.

    CSP: commands act at the next SYNC, and the drive's interpolation reaches them one period later. CST: the loop's
    own controller compares measured and wanted angles of the same cycle.
    """
    return 2 if mode == "csp" else 0


def feedback_loop(installation: Installation, mode: Mode) -> FeedbackLoop:
    """The servos in the drives (csp), or the host's controllers (cst)."""
    gains = [joint.servo if mode == "csp" else joint.digital for joint in installation.joint]
    return FeedbackLoop(
        np.array([g.stiffness_nm_rad for g in gains]),
        np.array([g.damping_nms_rad for g in gains]),
        1.0 / installation.cycle.rate_hz,
        # A servo's demand acts from its next tick on: in the drive, or after the next SYNC.
        2 if mode == "csp" else 3,
    )


def practised_motion(name: str, installation: Installation, mode: Mode) -> Practised:
    """The motion of that name or file for practice.

    Raises InputError when there is no such motion, or it leaves a limit (where, by how much, the speed that fits).
    """
    return practised_of(load_motion(name, installation), installation, mode)


def practised_of(motion: Motion, installation: Installation, mode: Mode) -> Practised:
    """The same of a motion that is in no file."""
    rate = installation.cycle.rate_hz
    sampled = sample(motion, rate)
    check_motion(sampled, installation, motion.name)
    reference = Reference.between_rests(
        sampled.q, sampled.dq, sampled.ddq, 1.0 / rate, round(REST_BEFORE_S * rate), round(REST_AFTER_S * rate)
    )
    # What the drive adds to it is identified from the replays.
    timing = Timing(held=True, advance=0.0 if mode == "csp" else 2.0)
    limits = [joint.limits for joint in installation.joint]
    return Practised(
        motion.name,
        installation,
        mode,
        reference,
        feedback_loop(installation, mode),
        timing,
        TorqueLimits(
            np.array([x.torque_nm for x in limits]),
            np.array([x.torque_rate_nm_s for x in limits]),
            np.array([x.position_rad for x in limits]),
            np.array([x.velocity_rad_s for x in limits]),
        ),
    )
