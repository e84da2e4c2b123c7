"""The friction that a joint may have of its own in one recording, as where it warmed up before and nobody says how
far."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, helmert

from estimator.effects import Signals

Array = NDArray[np.float64]

OWN = 2
"""Parts of it: a dry one, N·m, and a viscous one, N·m·s/rad."""
_SHARP = 0.02
"""Of a joint's rms speed, the width of the sign: by what frictions differ is told in motion, not at reversals."""
_LEAST_WIDTH = 1e-9


def own_friction(signals: Signals, joint: int) -> Array:
    """(samples, OWN) torques of a joint's dry friction and of its viscous one, of size one."""
    dq = signals.dq[:, joint]
    width = max(_SHARP * float(np.sqrt(np.mean(dq**2))), _LEAST_WIDTH)
    return np.stack([signals.direction(joint, width), dq], axis=1)


def courses(recordings: int) -> Array:
    """(recordings + 1, recordings + 1) of each recording, and of any other, its part in orthonormal courses over the
    recordings; the first is the same in all of them, and the last is the other's alone."""
    return np.asarray(block_diag(helmert(recordings, full=True).T, np.eye(1)))
