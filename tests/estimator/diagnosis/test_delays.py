"""Channels that come late, beside a small noise: the delay is told, and what it leaves is not called anything else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import butter, lfilter, lfilter_zi

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis
from estimator.effects import effect

Array = NDArray[np.float64]
Late = Callable[..., Diagnosis]

NOISE = np.array([0.9, 1.2, 0.7, 0.3, 0.15, 0.1])
"""N·m, white."""


@pytest.fixture(scope="module")
def late(six_axis: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]) -> Late:
    """Two playings of three motions that begin and end at speed, channels late by so many s, or torques ``filtered``:
    order and corner (Hz) of a Butterworth filter."""

    def make(
        noise: float,
        torque: float | Array = 0.0,
        position: float | Array = 0.0,
        velocity: float | Array | None = None,
        filtered: tuple[int, float] | None = None,
    ) -> Diagnosis:
        random = np.random.default_rng(1)
        true = six_axis.prior() * (1.0 + 0.02 * np.repeat(random.normal(size=six_axis.n), 10))
        recordings = []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(six_axis.n, 8.0, 500.0, 10 + motion)

            def behind(x: Array, delay: float | Array, t: Array = t) -> Array:
                each = np.broadcast_to(delay, x.shape[1])
                return np.array([CubicSpline(t, c)(t - s) for c, s in zip(x.T, each, strict=True)]).T

            tau = behind(inverse_dynamics(six_axis, true, q, dq, ddq), torque)
            if filtered is not None:
                order, corner = filtered
                b, a = butter(order, corner, fs=500.0)
                tau = lfilter(b, a, tau, axis=0, zi=lfilter_zi(b, a)[:, None] * tau[0])[0]
            angles, speeds = behind(q, position), None if velocity is None else behind(dq, velocity)
            recordings += [
                Trajectory(
                    t,
                    angles + 1e-6 * random.normal(size=q.shape),
                    tau + noise * NOISE * random.normal(size=q.shape),
                    None if speeds is None else speeds + 1e-3 * random.normal(size=q.shape),
                )
                for _ in range(2)
            ]
        return diagnose(six_axis, recordings)

    return make


@pytest.mark.parametrize("noise", [1.0, 0.2])
@pytest.mark.parametrize(
    ("channel", "joint", "delay"),
    [
        ("torque", None, 2e-3),
        ("torque", None, 5e-3),
        ("torque", 2, 5e-3),
        ("position", None, 4e-3),
        ("position", 1, 4e-3),
        ("velocity", None, 6e-3),
    ],
)
def test_a_late_channel_is_all_that_is_named(
    late: Late, channel: str, joint: int | None, delay: float, noise: float
) -> None:
    shift = delay if joint is None else delay * (np.arange(6) == joint)
    found = late(noise, **{channel: shift})
    (only,) = found.findings
    assert (only.effect, only.place.joint, only.place.channel) == ("transport_delay", joint, channel)
    told = only.parameters["delay"]
    assert abs(float(told.value) - delay) < 3.0 * float(told.standard_error)
    assert float(told.standard_error) < 0.03 * delay
    assert found.verdict == "named", found.unexplained


@pytest.mark.parametrize(("speed", "words"), [(0.0, "beside a speed that is in time"), (6e-3, "")])
def test_one_joint_s_angle_is_late_alone_or_with_its_speed(late: Late, speed: float, words: str) -> None:
    own = np.arange(6) == 2
    (only,) = late(1.0, position=6e-3 * own, velocity=speed * own).findings
    assert (only.effect, only.place.joint, only.place.channel) == ("transport_delay", 2, "position")
    assert effect(only.effect).form(only.shape) == words
    assert float(only.parameters["delay"].value) == pytest.approx(6e-3, rel=0.03)


def test_a_drive_of_which_all_is_late_is_late_in_each_of_its_channels(late: Late) -> None:
    """As of one whose frames come a cycle after the others'. Its torque is late against all angles but its own."""
    own = 8e-3 * (np.arange(6) == 1)
    found = late(0.3, torque=own, position=own, velocity=own)
    assert found.verdict == "named", found.unexplained
    told = {(f.effect, f.place.joint, f.place.channel): float(f.parameters["delay"].value) for f in found.findings}
    assert told == {
        ("transport_delay", 1, "torque"): pytest.approx(8e-3, rel=0.03),
        ("transport_delay", 1, "position"): pytest.approx(8e-3, rel=0.03),
    }


def test_a_long_delay_is_told_between_those_that_are_tried(late: Late) -> None:
    found = late(1.0, torque=12e-3)
    (only,) = found.findings
    assert float(only.parameters["delay"].value) == pytest.approx(12e-3, rel=0.02)


@pytest.mark.parametrize(("order", "words"), [(1, "first"), (2, "second")])
def test_filtered_torques_are_late_and_nothing_else(late: Late, order: int, words: str) -> None:
    """As by any filter of a drive: above a quarter of its corner its answer is no delay, which springs would mend."""
    corner = 12.0
    found = late(0.3, filtered=(order, corner))
    (only,) = found.findings
    assert (only.effect, only.place.joint, only.place.channel) == ("transport_delay", None, "torque")
    slow = (1.0 if order == 1 else np.sqrt(2.0)) / (2.0 * np.pi * corner)
    assert float(only.parameters["delay"].value) == pytest.approx(slow, rel=0.04)
    assert effect(only.effect).form(only.shape) == f"as of a low-pass filter of {words} order"
    assert found.verdict == "named", found.unexplained
