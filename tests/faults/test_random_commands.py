"""Random commands at the gate: what it lets through is within every limit on the wire, whatever was asked."""

from __future__ import annotations

import math
import os
import random

import pytest

from config import Installation, load_installation
from config.schema import Joint, Mode
from driver.cia402.pdo import CommandNotRepresentable, PdoCodec
from driver.cyclic.cycle import LoopState
from driver.cyclic.gate import COMMANDING, Gate
from tests.faults.bench import decoded_commands

pytestmark = pytest.mark.timeout(900)
COMMANDS = 1_000_000 if os.environ.get("ETUDE_FAULTS") == "full" else 100_000
ODD = (math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324, -0.0, 2.0**31, -(2.0**31), 1e9)
OTHER_STATES = tuple(LoopState)
GOAL_COMMANDS = 1000
"""So many commands lead towards one corner of what is allowed, and a little beyond it: there the limits are met."""
SLACK = 1e-6
"""Relative; the gate allows for the last digit of a command that just touches its limit."""


@pytest.fixture(scope="module")
def dda() -> Installation:
    return load_installation("dda")


class Axis:
    """What one joint is asked, and the bounds of what may come of it, from the installation's own words."""

    def __init__(self, joint: Joint, rate_hz: float) -> None:
        limits = joint.limits
        self.low, self.high = limits.position_rad
        self.torque, self.velocity = limits.torque_nm, limits.velocity_rad_s
        self.q_step, self.tau_step = limits.velocity_rad_s / rate_hz, limits.torque_rate_nm_s / rate_hz
        self.half_count = math.pi / joint.encoder.counts_per_turn * (1 + SLACK)
        self.half_permille = joint.rated_torque_nm / 2000 * (1 + SLACK)
        self.q, self.tau = (self.low + self.high) / 2, 0.0
        self.farthest = self.strongest = 0.0

    def towards(self, rng: random.Random) -> None:
        span = (self.high - self.low) / 2
        self.q_goal = (self.low + self.high) / 2 + _corner(rng) * span
        self.tau_goal = _corner(rng) * self.torque

    def ask(self, rng: random.Random) -> tuple[float, float, float]:
        """Position, velocity and torque: mostly a step that is allowed, at times just one or not at all."""
        q = self.q + _share(rng, self.q_goal - self.q, self.q_step)
        tau = self.tau + _share(rng, self.tau_goal - self.tau, self.tau_step)
        return q, _share(rng, rng.uniform(-1, 1) * self.velocity, self.velocity), tau

    def check_torque(self, value: float, steps: float) -> None:
        assert abs(value) <= self.torque * (1 + SLACK) + self.half_permille
        assert abs(value - self.tau) <= self.tau_step * steps * (1 + SLACK) + self.half_permille
        self.strongest = max(self.strongest, abs(value) / self.torque)

    def check_position(self, value: float) -> None:
        assert self.low - SLACK - self.half_count <= value <= self.high + SLACK + self.half_count
        assert abs(value - self.q) <= self.q_step * (1 + SLACK) + self.half_count
        self.farthest = max(self.farthest, abs(2 * value - self.low - self.high) / (self.high - self.low))


def _corner(rng: random.Random) -> float:
    """An end of what is allowed, seldom beyond it (what leads there is refused from then on), or anything between."""
    kind = rng.random()
    if kind < 0.05:
        return rng.choice((-1.01, 1.01))
    return rng.choice((-1.0, 1.0)) if kind < 0.7 else rng.uniform(-1, 1)


def _share(rng: random.Random, wanted: float, most: float) -> float:
    """A step towards what is wanted, of about the most that is allowed."""
    kind = rng.random()
    if kind < 0.002:
        return rng.choice(ODD)
    if kind < 0.004:
        return most * rng.uniform(-1, 1) * 10 ** rng.uniform(0, 8)
    if kind < 0.03:
        return math.copysign(most * rng.gauss(1, 1e-3), wanted)
    return max(-most, min(most, wanted)) * rng.random()


class Walk:
    """Commands one after another through one gate, each that passes checked as it is on the wire."""

    def __init__(self, installation: Installation, mode: Mode, seed: int) -> None:
        self.installation, self.mode, self.rng = installation, mode, random.Random(seed)
        self.axes = [Axis(joint, installation.cycle.rate_hz) for joint in installation.joint]
        self.gate, self.codec = Gate(installation), PdoCodec(installation, mode)
        self.passed = self.enabling = 0
        self._begin_inside()

    def _begin_inside(self) -> None:
        """As the loop does with its drives off: the reference is where the arm is."""
        for axis in self.axes:
            axis.q = max(axis.low, min(axis.high, axis.q)) if math.isfinite(axis.q) else axis.low
            axis.tau = max(-axis.torque, min(axis.torque, axis.tau)) if math.isfinite(axis.tau) else 0.0
        still = [0.0] * len(self.axes)
        q, tau = [axis.q for axis in self.axes], [axis.tau for axis in self.axes]
        off = [0] * len(self.axes)
        assert self.gate.check(LoopState.IDLE, off, q, still, tau, q, still, off, position_is_sent=True) is None

    def command(self) -> None:
        rng, count = self.rng, len(self.axes)
        state = LoopState.PLAYING if rng.random() < 0.97 else rng.choice(OTHER_STATES)
        words = [0x0F if rng.random() < 0.97 else rng.randrange(0x10000) for _ in range(count)]
        age = [0 if rng.random() < 0.97 else rng.randrange(12) for _ in range(count)]
        slower = rng.uniform(1, 10) if rng.random() < 0.02 else None
        interval_s = None if slower is None else slower / self.installation.cycle.rate_hz
        q_d, dq_d, tau = map(list, zip(*(axis.ask(rng) for axis in self.axes), strict=True))
        near = rng.random() < 0.95
        q, dq = ([axis.q for axis in self.axes], [0.0] * count) if near else (q_d, dq_d)
        refusal = self.gate.check(
            state, words, q_d, dq_d, tau, q, dq, age,
            position_is_sent=self.mode == "csp", torque_interval_s=interval_s,
        )  # fmt: skip
        if refusal is not None:
            return
        self.passed += 1
        if state in COMMANDING and state is not LoopState.STOPPING:
            assert max(age) <= self.installation.cycle.missed_deadlines_to_stop
        try:
            frames = self.codec.encode(words, q_d, dq_d, tau)
        except CommandNotRepresentable:
            # Then nothing is sent, and the loop stops the arm. Nothing that a drive would follow comes so far.
            assert state not in COMMANDING
            frames = []
        for bus, data in enumerate(frames):
            for joint, quantity, value in decoded_commands(self.installation, bus, bytes(data)):
                assert state in COMMANDING, "a drive was enabled in a state that commands nothing"
                self.enabling += 1
                if quantity == "torque":
                    self.axes[joint].check_torque(value, slower or 1.0)
                else:
                    self.axes[joint].check_position(value)
        for axis, q_now, tau_now in zip(self.axes, q_d, tau, strict=True):
            axis.q, axis.tau = q_now, tau_now
        if state is not LoopState.PLAYING:
            self._begin_inside()


@pytest.mark.parametrize("mode", ["csp", "cst"])
def test_nothing_beyond_the_limits_reaches_the_wire(mode: Mode, dda: Installation) -> None:
    walk = Walk(dda, mode, seed=11)
    commands = COMMANDS // 2
    for k in range(commands):
        if k % GOAL_COMMANDS == 0:
            for axis in walk.axes:
                axis.towards(walk.rng)
        walk.command()
    # No test is a gate that refuses everything, or a walk that never comes near a limit, or never beyond one.
    assert 0.4 * commands < walk.passed < 0.95 * commands
    assert walk.enabling > walk.passed
    assert all(axis.strongest > 0.95 for axis in walk.axes)
    assert mode == "cst" or all(axis.farthest > 0.95 for axis in walk.axes)
