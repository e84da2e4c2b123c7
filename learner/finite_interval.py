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
    """``norm``: greatest singular value of A − L·B; ``eigenvalue``: its greatest eigenvalue's size without any band
    limit or hold, which is told by the torque of the very sample: 1 − l[0]·b[0]."""

    norm: float
    eigenvalue: float
    propagation: Array
    """A − L·B itself, (blocks·n) square: δu_ff of one trial to δu_ff of the next, block after block."""


def finite_interval(
    arm: LinearArm,
    loop: FeedbackLoop,
    impulse: tuple[Array, Array],
    band_hz: float | None = None,
    hold: int = 1,
) -> FiniteInterval:
    """``arm`` and ``impulse`` (see `LearningOperator.impulse`) at each block of the interval, ``hold`` samples long.

    With ``hold`` above 1 the matrix is compressed to commands that are held over a block, by their means over it;
    within, the servo acts at its own rate. With ``band_hz`` the corrected command passes the zero-phase low-pass of
    that band. The servo has to hold the arm by itself: where it does not, errors grow beyond any number.
    """
    commands, errors = lifted(arm, loop, hold)
    samples, n, columns = commands.shape
    blocks = samples // hold
    now, before = (np.repeat(part, hold, axis=0) for part in impulse)
    needed = commands - now @ errors
    needed[1:] -= before[1:] @ errors[:-1]
    corrected = needed.reshape(blocks, hold, n, columns).sum(axis=1) / np.sqrt(hold)
    if band_hz is not None:
        gain = low_pass(lines_of(blocks, loop.period * hold), band_hz)
        corrected = to_history(gain[:, None, None] * to_lines(corrected))
    matrix = corrected.reshape(columns, columns)
    # No feedback is as young as the command: block by block, the matrix is lower triangular.
    eigenvalue = float(np.abs(np.linalg.eigvals(np.eye(n) - impulse[0] @ arm.sampled(loop.period)[1])).max())
    norm = float(svds(matrix, k=1, return_singular_vectors=False, rng=np.random.default_rng(0))[0])
    return FiniteInterval(norm, eigenvalue, matrix)


def lifted(arm: LinearArm, loop: FeedbackLoop, hold: int = 1) -> tuple[Array, Array]:
    """(A, B): commands (samples, n, blocks·n) and errors (samples, 2n, blocks·n) of feedforwards that are held over
    the ``hold`` samples of a block, of unit length (root of the sum of squares)."""
    a, b = arm.sampled(loop.period)
    blocks, n = len(a), arm.n
    columns = blocks * n
    commands = np.zeros((blocks * hold, n, columns))
    errors = np.zeros((blocks * hold, 2 * n, columns))
    state = np.zeros((2 * n, columns))
    for k in range(blocks * hold):
        block = k // hold
        # Later blocks have done nothing yet.
        begun = (block + 1) * n
        command = commands[k, :, :begun]
        command[np.arange(n), np.arange(n) + block * n] = 1.0 / np.sqrt(hold)
        if k >= loop.delay:
            command -= loop.gains @ errors[k - loop.delay, :, :begun]
        state[:, :begun] = a[block] @ state[:, :begun] + b[block] @ command
        errors[k] = state
    return commands, errors
