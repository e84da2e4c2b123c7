"""The same propagation over the learning interval's samples, as one matrix (Eq. 6.21 to 6.24).

Over a finite interval every learning operator with |1 − l[0]·b[0]| < 1 converges in the end, however its errors grow
on the way (Section 6.6.2). The matrix' norm tells how much they can grow in one trial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import svds

from learner.cosine_spectrum import frequencies as lines_of
from learner.cosine_spectrum import low_pass, to_history, to_lines
from learner.feedback_loop import FeedbackLoop
from learner.linearisation import LinearArm

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FiniteInterval:
    """``norm``: greatest singular value of A − L·B; ``eigenvalue``: its greatest eigenvalue's size."""

    norm: float
    eigenvalue: float
    propagation: Array
    """A − L·B itself, (samples·n) square: δu_ff of one trial to δu_ff of the next, sample after sample."""


def finite_interval(
    arm: LinearArm, loop: FeedbackLoop, impulse: tuple[Array, Array], band_hz: float | None = None
) -> FiniteInterval:
    """``arm`` and ``impulse`` (see `LearningOperator.impulse`) at each sample of the interval, ``loop.period`` apart.

    With ``band_hz`` the corrected command passes the zero-phase low-pass of that band.
    """
    commands, errors = lifted(arm, loop)
    samples, n, columns = commands.shape
    now, before = impulse
    corrected = commands - np.einsum("kij,kjc->kic", now, errors)
    corrected[1:] -= np.einsum("kij,kjc->kic", before[1:], errors[:-1])
    if band_hz is None:
        diagonal = corrected.reshape(samples, n, samples, n)[np.arange(samples), :, np.arange(samples), :]
        eigenvalue = float(np.abs(np.linalg.eigvals(diagonal)).max())
        matrix = corrected.reshape(columns, columns)
    else:
        gain = low_pass(lines_of(samples, loop.period), band_hz)
        matrix = to_history(gain[:, None, None] * to_lines(corrected)).reshape(columns, columns)
        eigenvalue = float(np.abs(np.linalg.eigvals(matrix)).max())
    norm = float(svds(matrix, k=1, return_singular_vectors=False, rng=np.random.default_rng(0))[0])
    return FiniteInterval(norm, eigenvalue, matrix)


def lifted(arm: LinearArm, loop: FeedbackLoop) -> tuple[Array, Array]:
    """(A, B): commands (samples, n, samples·n) and errors (samples, 2n, samples·n) of unit feedforwards."""
    a, b = arm.sampled(loop.period)
    samples, n = len(a), arm.n
    columns = samples * n
    commands = np.zeros((samples, n, columns))
    errors = np.zeros((samples, 2 * n, columns))
    state = np.zeros((2 * n, columns))
    for k in range(samples):
        command = commands[k]
        command[np.arange(n), np.arange(n) + k * n] = 1.0
        if k >= loop.delay:
            command -= loop.gains @ errors[k - loop.delay]
        state = a[k] @ state + b[k] @ command
        errors[k] = state
    return commands, errors
