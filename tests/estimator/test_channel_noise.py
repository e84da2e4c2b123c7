"""Noise spectra by redundant sensing, and the best union of angle and velocity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from estimator import Trajectory
from estimator.channel_noise import channel_noise
from estimator.filtering import plan_filter, smooth_motion

Array = NDArray[np.float64]
Motion = Callable[[int, float, float, int], tuple[Array, ...]]
RATE = 250.0


def measured(make_periodic: Motion, angle: float, velocity: float, colour: float = 0.0, seed: int = 1) -> Trajectory:
    t, q, dq, _ = make_periodic(3, 30.0, RATE, 4)
    random = np.random.default_rng(seed)
    shape = [np.sqrt(1.0 - colour**2)], [1.0, -colour]
    noise = [lfilter(*shape, random.normal(size=q.shape), axis=0) for _ in range(2)]
    return Trajectory(t, q + angle * noise[0], np.zeros_like(q), dq + velocity * noise[1])


@pytest.mark.parametrize(("angle", "velocity"), [(1e-4, 1e-2), (1e-3, 1e-2), (1e-4, 1e-1)])
def test_two_sensors_of_one_motion_tell_their_noises_apart(
    make_periodic: Motion, angle: float, velocity: float
) -> None:
    found = channel_noise([measured(make_periodic, angle, velocity)])
    assert found is not None
    assert found.velocity is not None
    density = np.array([angle, velocity]) ** 2 * 2.0 / RATE
    # Where the noise shows in the difference; elsewhere it does not matter.
    fast = 2 * np.pi * found.frequency > velocity / angle
    slow = 2 * np.pi * found.frequency < velocity / angle
    assert np.median(found.angle) == pytest.approx(density[0], rel=0.4)
    if fast.any():
        assert np.median(found.angle[fast]) == pytest.approx(density[0], rel=0.2)
    assert np.median(found.velocity[slow]) == pytest.approx(density[1], rel=0.2)
    # The optimum is flat: twice the crossover costs a few percent of noise.
    assert np.all(np.abs(np.log(found.crossover(25.0) * angle / velocity)) < np.log(2.0))


def test_coloured_noise_keeps_its_colour(make_periodic: Motion) -> None:
    found = channel_noise([measured(make_periodic, 1e-4, 1e-1, colour=0.9)])
    assert found is not None
    assert found.velocity is not None
    response = 0.19 / np.abs(1.0 - 0.9 * np.exp(-2j * np.pi * found.frequency / RATE)) ** 2 * 1e-2 * 2.0 / RATE
    ratio = np.mean(found.velocity, axis=1) / response
    assert np.median(np.abs(np.log(ratio))) < np.log(1.25)


def test_union_is_better_than_either_sensor(make_periodic: Motion) -> None:
    _, _, dq, ddq = make_periodic(3, 30.0, RATE, 4)
    seen = measured(make_periodic, 1e-3, 5e-2)
    found = channel_noise([seen])
    assert found is not None
    plan = plan_filter(RATE, 15.0, flat=2.0)
    inner = slice(plan.edge, len(dq) - plan.edge)

    def error(crossover: Array | None, velocity: Array | None) -> tuple[float, float]:
        motion = smooth_motion(plan, seen.q, velocity, None, crossover)
        return float(np.std(motion.dq - dq[inner])), float(np.std(motion.ddq - ddq[inner]))

    joined = error(found.crossover(15.0), seen.dq)
    angle_alone, velocity_alone = error(None, None), error(None, seen.dq)
    assert joined[0] < 0.9 * min(angle_alone[0], velocity_alone[0])
    assert joined[1] < 0.97 * min(angle_alone[1], velocity_alone[1])


def test_late_velocity_is_not_trusted(make_periodic: Motion) -> None:
    t, q, dq, _ = make_periodic(3, 30.0, RATE, 4)
    random = np.random.default_rng(3)
    noisy = q + 1e-5 * random.normal(size=q.shape), dq + 1e-4 * random.normal(size=q.shape)
    late = np.array([np.interp(t - 0.02, t, column) for column in noisy[1].T]).T
    crossovers = []
    for velocity in (noisy[1], late):
        found = channel_noise([Trajectory(t, noisy[0], np.zeros_like(q), velocity)])
        assert found is not None
        crossovers.append(found.crossover(25.0))
    assert np.all(crossovers[1] > 1.2 * crossovers[0])


def test_without_a_second_sensor_the_floor_is_the_noise(make_periodic: Motion) -> None:
    seen = measured(make_periodic, 1e-4, 1.0)
    found = channel_noise([Trajectory(seen.t, seen.q, seen.tau)])
    assert found is not None
    assert found.velocity is None
    assert np.median(found.angle) == pytest.approx(1e-8 * 2.0 / RATE, rel=0.2)
    assert np.isinf(found.crossover(25.0)).all()
    assert channel_noise([Trajectory(seen.t[:100], seen.q[:100], seen.tau[:100])]) is None
