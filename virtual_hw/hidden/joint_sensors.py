"""What the drive's own sensors get wrong: resolver or encoder, tachometer, torque measured from current."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from config.schema import Name, Positive, Section
from virtual_hw.hidden.noise import SILENT, Noise
from virtual_hw.hidden.quantities import NotNegative


class AngleSensor(Section):
    """measured = true − offset + a·sin(q + φ) + a_i·sin(k_i·q) + noise, then rounded to counts."""

    joint: Name
    offset_rad: float = 0.0
    """``encoder_offset``: true angle = measured + offset."""
    eccentricity_rad: NotNegative = 0.0
    eccentricity_phase_rad: float = 0.0
    interpolation_rad: NotNegative = 0.0
    """a_i: error of the interpolation between the sensor's own periods."""
    interpolation_order: Annotated[float, Field(gt=0)] = 2.0
    """k_i, periods a joint turn; 2 is the ellipse of a resolver with unequal windings."""
    delay_s: NotNegative = 0.0
    noise: Noise = SILENT
    """rad."""

    def error(self, q: float) -> float:
        """Deterministic part of measured − true, rad."""
        return (
            self.eccentricity_rad * math.sin(q + self.eccentricity_phase_rad)
            + self.interpolation_rad * math.sin(self.interpolation_order * q)
            - self.offset_rad
        )


class VelocitySensor(Section):
    """measured = gain·true·(1 + r·sin(k·q)) + offset + noise, through a first-order low-pass.

    Of a tachometer; a drive without one differentiates its counts, and only ``bandwidth_hz`` and ``delay_s`` act.
    """

    joint: Name
    gain: Positive = 1.0
    offset_rad_s: float = 0.0
    ripple: NotNegative = 0.0
    """r: commutator ripple, share of the speed."""
    ripple_order: Positive = 37.0
    bandwidth_hz: Positive | None = None
    """Of the electronics; for differentiated counts 150 Hz when absent, for a tachometer no filter."""
    delay_s: NotNegative = 0.0
    noise: Noise = SILENT
    """rad/s."""


class TorqueSensor(Section):
    """measured = torque current + offset + noise."""

    joint: Name
    offset_nm: float = 0.0
    delay_s: NotNegative = 0.0
    """From current to the measured value (channel ``torque``)."""
    noise: Noise = SILENT
    """N·m."""
