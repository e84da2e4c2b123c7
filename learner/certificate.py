"""The certificate: before anything moves, whether practising this motion with this operator can only help."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from learner.cosine_spectrum import frequencies as lines_of
from learner.cosine_spectrum import low_pass, to_lines
from learner.error_gain import Tolerance, error_gain
from learner.feedback_loop import FeedbackLoop
from learner.finite_interval import finite_interval
from learner.inverse_model import InverseModel
from learner.linearisation import LinearArm, linearise, spread
from learner.operators import LearningOperator
from learner.servo_poles import Swinging, swinging
from learner.trial import Reference

Array = NDArray[np.float64]
LINES = 48
"""Frequencies at which the gain is told, in equal ratios."""
INSTANTS = 16
"""Instants of the motion at which the arm is linearised."""
INTERVAL_COLUMNS = 175
"""Size of the finite-interval matrix: samples × joints after thinning."""
MOTION_ENERGY = 0.995
"""Share of the wanted acceleration's energy that lies below the motion's band."""
LARGEST_GAIN = 0.95
"""A gain this near to 1 shrinks nothing any more."""
MARGIN = 0.8
"""Of the frequency at which the gain reaches `LARGEST_GAIN`, where a band-limited operator ends."""


@dataclass(frozen=True)
class Certificate:
    """What practice will do, by the model. ``gain`` is the greatest spectral radius of Λ along the motion, of the
    operator without its band limit; ``learning_bandwidth`` is where it reaches `LARGEST_GAIN` first."""

    operator: str
    verdict: Literal["converges", "refused"]
    reason: str
    frequency: float | None
    """Hz: where the operator amplifies; None where it never does."""
    frequencies: Array
    gain: Array
    learning_bandwidth: float
    band_hz: float
    """Up to which the operator is used; 0 when it is refused."""
    motion_band: float
    expected_error_ratio: float
    """Command error after a trial to the one before it, over the motion's own spectrum."""
    finite_interval_norm: float | None
    """Greatest growth of any error in one trial, with the band limit; None where the servo alone is unstable."""
    finite_interval_eigenvalue: float | None
    """Greatest eigenvalue without the band limit: below 1, and still no promise (Section 6.6.2)."""

    @property
    def admitted(self) -> bool:
        return self.verdict == "converges"

    def gain_at(self, frequency: Array) -> Array:
        """The gain between the told frequencies, by its logarithm; the first one's below."""
        return np.asarray(np.exp(np.interp(frequency, self.frequencies, np.log(np.maximum(self.gain, 1e-6)))))

    def as_json(self) -> dict[str, Any]:
        return {
            "operator": self.operator,
            "verdict": self.verdict,
            "reason": self.reason,
            "frequency": self.frequency,
            "gain": [
                {"frequency": float(f), "spectral_radius": float(g)}
                for f, g in zip(self.frequencies, self.gain, strict=True)
            ],
            "learning_bandwidth": self.learning_bandwidth,
            "band_hz": self.band_hz,
            "motion_band": self.motion_band,
            "expected_error_ratio": self.expected_error_ratio,
            "finite_interval": {"norm": self.finite_interval_norm, "eigenvalue": self.finite_interval_eigenvalue},
        }


def certify(
    model: InverseModel,
    reference: Reference,
    loop: FeedbackLoop,
    operator: LearningOperator,
    tolerance: Tolerance | None = None,
    band_hz: float | None = None,
) -> Certificate:
    """Judge ``operator`` on the arm of ``model``, which may be wrong within ``tolerance``.

    It is refused when the servo does not hold that arm by itself, or when it would not shrink errors over the whole
    band in which the motion's torques lie. Otherwise it is used up to ``band_hz``, or where that is None or too high,
    up to where it converges.
    """
    nyquist = 0.5 / reference.period
    frequencies = np.geomspace(0.1 / (reference.samples * reference.period), nyquist, LINES)
    at = spread_moving(reference, INSTANTS)
    arm = linearise(model, reference.q[at], reference.dq[at], reference.ddq[at])
    gain = error_gain(arm, loop, operator.response(frequencies, reference, at), frequencies, tolerance).max(axis=1)
    unstable = swinging(arm, loop)
    bandwidth = first_crossing(frequencies, gain) if unstable is None else 0.0
    needed = motion_band(reference)
    reach = MARGIN * bandwidth if bandwidth < nyquist else nyquist
    admitted = reach > needed
    band = min(reach, band_hz or nyquist) if admitted else 0.0
    crossing = bandwidth if bandwidth < nyquist else None
    worst = int(np.argmax(gain))
    norm: float | None = None
    eigenvalue: float | None = None
    if unstable is not None:
        reason = _does_not_hold(unstable, int(at[unstable.instant]) * reference.period)
        crossing = unstable.frequency
    else:
        norm, eigenvalue = _interval(model, reference, loop, operator, band if crossing and admitted else None)
        if not admitted:
            reason = (
                f"errors above {bandwidth:.3g} Hz come back {LARGEST_GAIN:g} times as large or larger, up to "
                f"{gain[worst]:.3g} times at {frequencies[worst]:.3g} Hz, and this motion reaches to {needed:.3g} Hz"
            )
        elif crossing is None:
            reason = "errors shrink at every frequency"
        else:
            reason = (
                f"errors shrink up to {bandwidth:.3g} Hz, beyond what this motion asks for ({needed:.3g} Hz), but "
                f"{gain[worst]:.3g} times at {frequencies[worst]:.3g} Hz: the operator ends at {band:.3g} Hz"
            )
    return Certificate(
        operator=operator.name,
        verdict="converges" if admitted else "refused",
        reason=reason,
        frequency=crossing,
        frequencies=frequencies,
        gain=gain,
        learning_bandwidth=bandwidth,
        band_hz=band,
        motion_band=needed,
        expected_error_ratio=_expected_ratio(reference, frequencies, gain, band),
        finite_interval_norm=norm,
        finite_interval_eigenvalue=eigenvalue,
    )


def _does_not_hold(found: Swinging, at_s: float) -> str:
    return (
        f"the servo would not hold the arm that the model describes: at {at_s:.3g} s joint number {found.joint + 1} "
        f"swings at {found.frequency:.3g} Hz, {found.growth:.3g} times as far each sample; if the arm itself is at "
        "rest under this servo, the model is wrong, as one without the rotors' inertia is: identify the links and name "
        "their model"
    )


def first_crossing(frequencies: Array, gain: Array) -> float:
    """Hz at which the gain first reaches `LARGEST_GAIN`: 0 when it does so from the start, the last when never."""
    over = np.flatnonzero(gain >= LARGEST_GAIN)
    if not over.size:
        return float(frequencies[-1])
    k = int(over[0])
    if k == 0:
        return 0.0
    low, high = np.log(gain[k - 1]), np.log(gain[k])
    share = (np.log(LARGEST_GAIN) - low) / (high - low)
    return float(frequencies[k - 1] * (frequencies[k] / frequencies[k - 1]) ** share)


def motion_band(reference: Reference) -> float:
    """Hz below which `MOTION_ENERGY` of the wanted acceleration lies, the widest joint; 0 without any motion."""
    acceleration = reference.ddq[reference.moving]
    energy = to_lines(acceleration) ** 2
    total = energy.sum(axis=0)
    moving = total > 0.0
    if not moving.any():
        return 0.0
    reached = np.argmax(np.cumsum(energy[:, moving], axis=0) >= MOTION_ENERGY * total[moving], axis=0)
    return float(lines_of(len(acceleration), reference.period)[reached.max()])


def spread_moving(reference: Reference, count: int) -> NDArray[np.intp]:
    """Indices of instants of the reference, spread evenly over its moving samples."""
    start, stop, _ = reference.moving.indices(reference.samples)
    return start + spread(stop - start, count)


def _expected_ratio(reference: Reference, frequencies: Array, gain: Array, band: float) -> float:
    if band <= 0.0:
        return float(gain.max())
    energy = np.sum(to_lines(reference.ddq[reference.moving]) ** 2, axis=1)
    lines = lines_of(len(energy), reference.period)
    passed = low_pass(lines, band)
    left = passed * np.interp(lines, frequencies, gain) + (1.0 - passed)
    return float(np.sqrt(np.sum(energy * left**2) / np.sum(energy))) if energy.any() else 0.0


def _interval(
    model: InverseModel, reference: Reference, loop: FeedbackLoop, operator: LearningOperator, band: float | None
) -> tuple[float, float]:
    """(norm with the band limit, eigenvalue without) over the moving samples, of commands held over so many samples
    that the matrix has at most `INTERVAL_COLUMNS`."""
    start, stop, _ = reference.moving.indices(reference.samples)
    hold = max(1, -(-(stop - start) * reference.n // INTERVAL_COLUMNS))
    at = np.arange(start + hold // 2, stop, hold)[: max(1, (stop - start) // hold)]
    linear: LinearArm = linearise(model, reference.q[at], reference.dq[at], reference.ddq[at])
    impulse = operator.impulse(reference, at)
    found = finite_interval(linear, loop, impulse, band, hold)
    return found.norm, found.eigenvalue
