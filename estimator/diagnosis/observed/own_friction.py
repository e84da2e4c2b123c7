"""The friction that a joint may have of its own in one recording, as where it warmed up before and nobody says how
far."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

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


def courses(vigour: Array) -> Array:
    """(recordings + 1, recordings + 1, OWN) of each recording, and of any other, its part in orthonormal courses over
    the recordings. The first goes with each part's ``vigour`` (recordings, OWN), its energy in each of them: what is
    orthogonal to it looks like no friction that all recordings have. The last is the other's alone."""
    result = []
    for energy in vigour.T:
        first = np.zeros(len(energy))
        first[0] = 1.0
        size = float(np.linalg.norm(energy))
        aside = first - (energy / size if size > 0.0 else first)
        turned = float(aside @ aside)
        # The reflection that takes the first axis there.
        own = np.eye(len(energy)) - (2.0 / turned * np.outer(aside, aside) if turned > 0.0 else 0.0)
        result.append(block_diag(own, np.eye(1)))
    return np.stack(result, axis=-1)
