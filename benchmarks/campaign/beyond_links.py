"""How much evidence recordings hold for a cause that links within their tolerance cannot imitate.

An oracle who is told the cause's torque asks only whether links that are off explain it as well.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from benchmarks.campaign.motions import RATE_HZ
from benchmarks.campaign.sizing import BAND_HZ, EVERY, Array, Scale, left_by_bodies
from estimator import RigidBody
from estimator.diagnosis.observed.tolerance import link_covariance
from estimator.regressor import torque_regressor
from virtual_hw.hidden import HiddenMechanics

ROWS_HZ = 4.0 * BAND_HZ
"""Of what is below the band, enough."""


def evidence_beyond_links(
    scale: Scale, hidden: HiddenMechanics, body: RigidBody, noise_below: Array, tolerance: float
) -> float:
    """Expected log-likelihood, nats, of what ``hidden`` does beside the clean arm of ``scale``, over the ``body``'s
    links off by ``tolerance`` (standard deviation, relative), in all recordings that are learnt from.

    ``noise_below`` (n,) rms of the torque noise below `BAND_HZ`, N·m. Gaussian: ½ eᵀ(N + Y P Yᵀ)⁻¹e, e the torque that
    the true bodies leave, Y their regressor, P the links' covariance, N the noise's.
    """
    playings = Counter(scale.playlist.order)
    step = round(RATE_HZ / EVERY / ROWS_HZ)
    share = np.sqrt(2.0 * BAND_HZ * EVERY * step / RATE_HZ)
    normal, right, square = np.zeros((10 * body.n, 10 * body.n)), np.zeros(10 * body.n), 0.0
    for name, motion in left_by_bodies(scale.played(hidden), scale.installation, scale.clean):
        left, *state = (x[::step] for x in motion)
        # Rows in units of the noise: the band holds fewer independent ones than are kept.
        rows = (share * left / noise_below).ravel()
        columns = torque_regressor(body, *state).reshape(-1, body.n, 10 * body.n) * (share / noise_below)[:, None]
        columns = columns.reshape(-1, 10 * body.n)
        normal += playings[name] * columns.T @ columns
        right += playings[name] * columns.T @ rows
        square += playings[name] * float(rows @ rows)
    spread = np.linalg.cholesky(link_covariance(body, tolerance))
    imitated = spread.T @ right
    return 0.5 * float(square - imitated @ np.linalg.solve(np.eye(len(right)) + spread.T @ normal @ spread, imitated))
