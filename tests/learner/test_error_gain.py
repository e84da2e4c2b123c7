"""Section 6.6 by number: one joint of constant inertia, a servo of 10 Hz with damping 0.707."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from learner.certificate import certify
from learner.error_gain import Tolerance, error_gain
from learner.feedback_loop import FeedbackLoop
from learner.finite_interval import finite_interval, lifted
from learner.inverse_model import DecoupledModel
from learner.kinematics import Kinematics
from learner.linearisation import LinearArm
from learner.operators import ModelOperator, inverse_of
from learner.trial import Reference

Array = NDArray[np.float64]
INERTIA = 0.7
"""kg·m²; nothing depends on it."""


def joint(points: int = 1) -> LinearArm:
    one = np.full((points, 1, 1), INERTIA)
    return LinearArm(one, 0.0 * one, 0.0 * one)


def servo(rate_hz: float) -> FeedbackLoop:
    """Gains that put the poles at exp(s·h) for 10 Hz, ζ = 0.707 (k/I = 3776.31, b/I = 86.9001 at 1 kHz)."""
    h, omega, zeta = 1.0 / rate_hz, 2 * np.pi * 10.0, 0.707
    pole = np.exp((-zeta + 1j * np.sqrt(1 - zeta**2)) * omega * h)
    # y[k] = (A − B·[k b])·y[k−1] has the polynomial z² − (2 − kh²/2 − bh)·z + (1 + kh²/2 − bh).
    total, product = 2.0 * pole.real, abs(pole) ** 2
    b = (3.0 - total - product) / (2.0 * h)
    k = (1.0 - total + product) / h**2
    return FeedbackLoop(np.array([k * INERTIA]), np.array([b * INERTIA]), h)


def scaled_position_error(period: float, points: int = 1) -> tuple[Array, Array]:
    """Eq. 6.27: l[0] = 1/b[0] = 2I/h² on the angle's error, nothing else."""
    now = np.tile([[2.0 * INERTIA / period**2, 0.0]], (points, 1, 1))
    return now, np.zeros_like(now)


def gain_of(
    impulse: tuple[Array, Array], rate_hz: float, frequencies: Array, tolerance: Tolerance | None = None
) -> Array:
    back = np.exp(-2j * np.pi * frequencies / rate_hz)[:, None, None, None]
    response = impulse[0][None] + back * impulse[1][None]
    return error_gain(joint(), servo(rate_hz), response, frequencies, tolerance)[:, 0]


def test_gains_of_the_example() -> None:
    loop = servo(1000.0)
    assert loop.stiffness[0] / INERTIA == pytest.approx(3776.31, abs=0.01)
    assert loop.damping[0] / INERTIA == pytest.approx(86.9001, abs=0.0001)


def test_the_thesis_bad_operator_amplifies_530_times() -> None:
    frequencies = np.array([0.01, 500.0])
    low, nyquist = gain_of(scaled_position_error(1e-3), 1000.0, frequencies)
    assert low == pytest.approx(529.6, abs=0.1)
    assert nyquist == pytest.approx(1.045, abs=0.001)


@pytest.mark.parametrize(("rate_hz", "expected"), [(500.0, 138.0), (200.0, 25.0), (100.0, 8.0), (40.0, 3.4)])
def test_slow_sampling_is_kinder(rate_hz: float, expected: float) -> None:
    frequencies = np.geomspace(0.01, rate_hz / 2, 400)
    assert gain_of(scaled_position_error(1.0 / rate_hz), rate_hz, frequencies).max() == pytest.approx(
        expected, rel=0.02
    )


@pytest.mark.parametrize("share", [0.05, 0.2, -0.3])
def test_a_wrong_inertia_costs_its_share(share: float) -> None:
    frequencies = np.geomspace(0.1, 500.0, 300)
    wrong = inverse_of(joint().heavier(share), 1e-3)
    assert gain_of(wrong, 1000.0, frequencies).max() == pytest.approx(1.05 * abs(share), rel=0.01)


@pytest.mark.parametrize(("delay_s", "expected_hz"), [(1e-3, 159.0), (5e-3, 32.0)])
def test_an_unknown_delay_caps_the_band(delay_s: float, expected_hz: float) -> None:
    frequencies = np.linspace(1.0, 400.0, 4000)
    gain = gain_of(inverse_of(joint(), 1e-3), 1000.0, frequencies, Tolerance(delay_s=delay_s))
    over = frequencies[np.argmax(gain >= 1.0)]
    assert over == pytest.approx(expected_hz, rel=0.05)
    assert over == pytest.approx(1.0 / (6.0 * delay_s), rel=0.1)


@pytest.mark.parametrize(("samples", "norm"), [(50, 375.0), (100, 498.0), (200, 526.0), (500, 529.5)])
def test_finite_interval_norms(samples: int, norm: float) -> None:
    found = finite_interval(joint(samples), servo(1000.0), scaled_position_error(1e-3, samples))
    assert found.eigenvalue == pytest.approx(0.0, abs=1e-9)
    assert found.norm == pytest.approx(norm, rel=0.002)


def test_held_commands_see_the_servo_at_its_own_rate() -> None:
    """The matrix of held commands is the whole one between the blocks' constants, in an arm that changes by block."""
    hold, blocks = 8, 25
    inertia = INERTIA * (1.0 + 0.5 * np.sin(np.arange(blocks) / 4.0))[:, None, None]
    coarse = LinearArm(inertia, 0.3 * inertia, 2.0 * inertia)
    fine = LinearArm(*(np.repeat(part, hold, axis=0) for part in (coarse.inertia, coarse.damping, coarse.stiffness)))
    loop = FeedbackLoop(*(getattr(servo(1000.0), name) for name in ("stiffness", "damping", "period")), delay=3)
    wrong = inverse_of(coarse.heavier(0.4), 1e-3)
    whole = finite_interval(fine, loop, (np.repeat(wrong[0], hold, axis=0), np.repeat(wrong[1], hold, axis=0)))
    constants = np.repeat(np.eye(blocks), hold, axis=0) / np.sqrt(hold)
    held = finite_interval(coarse, loop, wrong, None, hold)
    np.testing.assert_allclose(held.propagation, constants.T @ whole.propagation @ constants, atol=1e-9)
    assert 0.3 < held.norm <= whole.norm


def test_errors_grow_by_26_orders_in_ten_updates() -> None:
    samples = 200
    arm, loop = joint(samples), servo(1000.0)
    _, errors = lifted(arm, loop)
    propagation = finite_interval(arm, loop, scaled_position_error(1e-3, samples)).propagation
    command = np.zeros(samples)
    command[0] = 1.0
    first = np.abs(errors[:, 0] @ command).max()
    for _ in range(10):
        command = propagation @ command
    assert np.abs(errors[:, 0] @ command).max() / first == pytest.approx(2.3e26, rel=0.05)


def test_the_right_inverse_needs_one_trial() -> None:
    samples = 200
    found = finite_interval(joint(samples), servo(1000.0), inverse_of(joint(samples), 1e-3))
    assert found.norm < 1e-9


class ScaledPositionError:
    """Eq. 6.27 as an operator, for the certificate."""

    name = "scaled position error"

    def command_error(self, trial: object, reference: object) -> Array:
        raise AssertionError("the certificate moves nothing")

    def impulse(self, reference: Reference, at: NDArray[np.intp]) -> tuple[Array, Array]:
        return scaled_position_error(reference.period, len(at))

    def response(self, frequencies: Array, reference: Reference, at: NDArray[np.intp]) -> NDArray[np.complex128]:
        now, _ = self.impulse(reference, at)
        return np.tile(now[None] + 0j, (len(frequencies), 1, 1, 1))


def still(samples: int) -> Reference:
    t = np.linspace(0.0, 1.0, samples)[:, None]
    shape = 10 * t**3 - 15 * t**4 + 6 * t**5
    rate = 1.0 / (samples * 1e-3)
    return Reference(
        shape,
        (30 * t**2 - 60 * t**3 + 30 * t**4) * rate,
        (60 * t - 180 * t**2 + 120 * t**3) * rate**2,
        1e-3,
        slice(0, samples),
    )


def test_the_certificate_refuses_it_although_every_eigenvalue_is_zero() -> None:
    model = DecoupledModel(np.array([INERTIA]))
    found = certify(model, still(450), servo(1000.0), ScaledPositionError())
    assert found.verdict == "refused"
    assert found.gain.max() == pytest.approx(529.6, abs=0.2)
    assert found.finite_interval_eigenvalue < 1e-9
    assert found.learning_bandwidth == 0.0
    assert "Hz" in found.reason
    inverse = ModelOperator(model, Kinematics(1e-3, held=True, flat_hz=None))
    right = certify(model, still(450), servo(1000.0), inverse)
    assert right.verdict == "converges"
    assert right.gain.max() < 1e-6
    assert right.expected_error_ratio < 1e-6
