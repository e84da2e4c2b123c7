"""What a wrist sensor gets wrong: bias, drift, calibration, mounting, delay, compliance, noise, its line's bursts."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from config.schema import Name, Positive, Section
from virtual_hw.hidden.noise import SILENT, Noise
from virtual_hw.hidden.quantities import Fraction, NotNegative, Vector3

Six = tuple[float, float, float, float, float, float]


class Compliance(Section):
    """One direction of the sensor that gives: the load swings on it. Lightly damped in strain-gauge sensors."""

    axis: Literal["x", "y", "z", "rx", "ry", "rz"]
    stiffness: Positive
    """N/m along x, y, z; N·m/rad about them."""
    damping: Fraction = 0.02
    """Damping ratio with the load that is on it at the start."""


class WrenchErrors(Section):
    """measured = matrix·R(rotation)ᵀ·true + bias + rate·t + noise, delayed, then the sensor's own filters."""

    sensor: Name
    bias: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    """N, N·m."""
    drift_per_s: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    matrix: tuple[Six, Six, Six, Six, Six, Six] | None = None
    """Calibration error; the identity when absent."""
    rotation_rad: Vector3 = (0.0, 0.0, 0.0)
    """Rotation vector of the true sensor frame against the URDF's."""
    delay_s: NotNegative = 0.0
    force_noise: Noise = SILENT
    """N."""
    torque_noise: Noise = SILENT
    """N·m."""
    compliance: Annotated[tuple[Compliance, ...], Field(max_length=6)] = ()
    temperature_c: float = 25.0
    latency_ms: NotNegative = 0.0
    """Latency timer of the USB bridge: bytes come in bursts this far apart (16 ms as FTDI chips ship)."""
    crystal_ppm: float = 0.0
    """Rate error of the sensor's own clock."""
    first_timestamp_us: Annotated[int, Field(ge=0, lt=2**32)] = 0
    """Where the sensor's 32-bit microsecond clock starts."""
