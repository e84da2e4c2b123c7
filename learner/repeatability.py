"""How well the arm repeats itself: the floor of what practice can reach, measured before it begins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from learner.trial import Reference, Trial

Array = NDArray[np.float64]
FEWEST_REPLAYS = 5
INDISTINGUISHABLE = 2.0
"""Standard deviations of one trial's mean square error by which it may exceed repeatability."""


@dataclass(frozen=True)
class Repeatability:
    """Of the same command played ``replays`` times: (n,) each."""

    replays: int
    velocity: Array
    """rad/s: RMS over the moving samples of one replay about the mean of all, unbiased, and ``counting``."""
    position: Array
    """rad: the same of the angles."""
    counting: Array
    """rad/s: the part of ``velocity`` that an encoder's counts would tell of the wanted motion itself."""
    scatter: Array
    """Standard deviation of one replay's mean square about its own mean value, relative."""

    @property
    def bound(self) -> Array:
        """rad/s: a velocity error up to this cannot be told from repeatability."""
        return np.asarray(self.velocity * np.sqrt(1.0 + INDISTINGUISHABLE * self.scatter))


def repeatability(replays: Sequence[Trial], reference: Reference, as_read: Sequence[Trial] = ()) -> Repeatability:
    """From five or more plays of one command; ``as_read``: the wanted motion by the encoders' counts.

    Raises InputError when there are fewer, or one is not whole.
    """
    count = len(replays)
    if count < FEWEST_REPLAYS:
        raise InputError("repeatability", f"was measured on {count} replays", f"play at least {FEWEST_REPLAYS}")
    for k, trial in enumerate(replays):
        trial.check(reference, f"replay {k + 1}")
    dq, q = (np.array([getattr(t, name)[reference.moving] for t in replays]) for name in ("dq", "q"))
    unbiased = count / (count - 1)
    powers = np.mean((dq - dq.mean(axis=0)) ** 2, axis=1) * unbiased
    counted_dq, counted_q = np.zeros(reference.n), np.zeros(reference.n)
    if as_read:
        counted_dq = np.mean([trial.velocity_error_rms(reference) ** 2 for trial in as_read], axis=0)
        counted_q = np.mean([(trial.q - reference.q)[reference.moving] ** 2 for trial in as_read], axis=(0, 1))
    power = powers.mean(axis=0) + counted_dq
    return Repeatability(
        replays=count,
        velocity=np.sqrt(power),
        position=np.sqrt(np.mean((q - q.mean(axis=0)) ** 2, axis=(0, 1)) * unbiased + counted_q),
        counting=np.sqrt(counted_dq),
        scatter=powers.std(axis=0, ddof=1) / power,
    )
