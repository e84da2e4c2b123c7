"""How well a recorded arm followed what was asked of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from driver.recording import Recording

Array = NDArray[np.float64]


def tracking_errors(recording: Recording, delay: int) -> dict[str, dict[str, float]]:
    """Per joint: RMS and peak of measured minus wanted position [rad] and velocity [rad/s].

    ``delay``: cycles that a command needs to the drive and into its reference (`planning.command_delay`).

    Samples that are missing on either side do not count; all missing gives NaN. Empty without /command.
    """
    if recording.q_d is None:
        return {}
    errors: dict[str, dict[str, float]] = {}
    for i, joint in enumerate(recording.joints):
        entry = {}
        for name, measured, wanted in (
            ("position", recording.q, recording.q_d),
            ("velocity", recording.dq, recording.dq_d),
        ):
            if measured is None or wanted is None:
                continue
            error: Array = measured[delay:, i] - wanted[: len(wanted) - delay, i]
            error = error[np.isfinite(error)]
            entry[f"{name}_rms"] = float(np.sqrt(np.mean(error**2))) if error.size else float("nan")
            entry[f"{name}_peak"] = float(np.max(np.abs(error))) if error.size else float("nan")
        errors[joint] = entry
    return errors
