"""The feedback that acts during a trial, as the certificate needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class FeedbackLoop:
    """u[k] = u_ff[k] − K·δq[k−delay] − D·δdq[k−delay] (Eq. 6.19), sampled every ``period`` s.

    ``stiffness`` K [N·m/rad] and ``damping`` D [N·m·s/rad]: (n,), one servo a joint. ``delay`` in samples, at least 1,
    counted to the period that ends with sample k (`LinearArm.sampled`).
    """

    stiffness: Array
    damping: Array
    period: float
    delay: int = 1

    @property
    def gains(self) -> Array:
        """(n, 2n): [K D]."""
        return np.hstack([np.diag(self.stiffness), np.diag(self.damping)])

    def response(self, frequencies: Array) -> Complex:
        """C of u = −C·y at the frequencies [Hz]: (frequencies, n, 2n)."""
        z = np.exp(2j * np.pi * np.asarray(frequencies) * self.period)
        return np.asarray(z[:, None, None] ** -self.delay * self.gains)
