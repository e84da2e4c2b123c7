"""Chapter 3's own estimate of a load: plain least squares, differentiated or integrated, all channels alike.

Eq. 3.13 without weights: no noise spectrum, no delay of the sensor, no drift; only a constant offset of each channel.
What the estimator does beyond it is what the optimal filters of chapter 5 are for.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.filtering import plan_filter
from estimator.loads import LoadRecording, RigidLoad
from estimator.loads.layout import wrench_layout
from estimator.loads.rows import Form, load_rows
from estimator.rigid_body import RigidBody


def plain_estimate(
    body: RigidBody, frame: str, recordings: Sequence[LoadRecording], form: Form, cut_off_hz: float
) -> RigidLoad:
    """``cut_off_hz``: of the low-pass that motion and wrench share. There is no covariance: chapter 3 has none."""
    layout = wrench_layout(tuple(range(6)), "constant", len(recordings))
    gram, right = np.zeros((layout.size, layout.size)), np.zeros(layout.size)
    for number, recording in enumerate(recordings):
        plan = plan_filter(recording.motion.rate, cut_off_hz, stride_limit=1)
        for rows in load_rows(body, frame, layout, recording, number, plan, form):
            for k, columns in enumerate(rows.columns):
                mine = layout.unknowns(k)
                gram[np.ix_(mine, mine)] += columns[:-1] @ columns[:-1].T
                right[mine] += columns[:-1] @ columns[-1]
    return RigidLoad(np.asarray(np.linalg.solve(gram, right)[:10], dtype=np.float64))
