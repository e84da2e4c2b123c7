"""The motor and its current loop: what becomes of a torque demand, and what the drive believes it made of it.

demand → delay → limit → first-order current loop → torque current i·K_T (what the drive measures)
       → g·(1 + α·ΔT)·i·K_T, ripple, loss near zero, saturation → torque on the rotor
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from config.schema import Name, Positive, Section
from virtual_hw.hidden.delay import DelayLine
from virtual_hw.hidden.periodic import Harmonics
from virtual_hw.hidden.quantities import NotNegative


class Thermal(Section):
    """One thermal mass: C·dT/dt = r·τ² + |friction power| − (T − T_ambient)/R."""

    capacity_j_k: Positive
    resistance_k_w: Positive
    loss_w_nm2: NotNegative
    """r: copper loss for a squared N·m of joint torque."""
    ambient_c: float = 22.0
    initial_c: float | None = None
    """Ambient when absent."""


class Motor(Section):
    """Motor and current loop of one joint; torque at the joint."""

    joint: Name
    bandwidth_hz: Positive = 600.0
    """Current loop, first order."""
    peak_torque_nm: Positive | None = None
    """The current limit; the installation's torque limit when absent."""
    delay_s: NotNegative = 0.0
    """From demand to current (channel ``torque``)."""
    gain: Positive = 1.0
    """g: true torque = g·measured (``torque_constant_error``)."""
    gain_per_kelvin: float = 0.0
    """Magnets weaken as they warm."""
    dead_zone_nm: NotNegative = 0.0
    """Torque lost near zero: true = sign·max(0, |τ| − dead zone)."""
    saturation_nm: Positive | None = None
    """True torque levels off as s·tanh(τ/s)."""
    torque_constant_nm_a: Positive = 10.0
    """K_T of Eq. 4.10, of the phase currents as amplitudes, through the gear."""
    pole_pairs: Annotated[int, Field(ge=1)] = 15
    """Electrical turns a joint turn."""
    phase_gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    phase_offset_a: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Errors of the three phase current sensors."""
    phase_noise_a: NotNegative = 0.0
    thermal: Thermal | None = None
    brake_torque_nm: Positive | None = None
    """What the holding brake holds; three times the installation's torque limit when absent."""


class MotorState:
    """The motor at run time. ``current_nm`` is the torque current, N·m by the nominal torque constant."""

    __slots__ = (
        "_ambient",
        "_cooling",
        "_dead_zone",
        "_decay",
        "_delay",
        "_gain",
        "_gain_per_kelvin",
        "_heating",
        "_loss",
        "_mean_share",
        "_peak",
        "_ripple",
        "_saturation",
        "_thermal",
        "current_nm",
        "kelvin",
    )

    def __init__(self, law: Motor, ripple: Harmonics, peak_torque_nm: float, period_s: float) -> None:
        self._peak = peak_torque_nm if law.peak_torque_nm is None else law.peak_torque_nm
        self._delay = DelayLine(law.delay_s, period_s, 0.0) if law.delay_s else None
        x = 2.0 * math.pi * law.bandwidth_hz * period_s
        self._decay = math.exp(-x)
        # Mean over the period of the decaying start value: the impulse is exact however slow the tick.
        self._mean_share = (1.0 - self._decay) / x
        self._gain, self._gain_per_kelvin = law.gain, law.gain_per_kelvin
        self._dead_zone, self._saturation = law.dead_zone_nm, law.saturation_nm or 0.0
        self._ripple = ripple if ripple else None
        self.current_nm = 0.0
        thermal = law.thermal
        self._thermal = thermal is not None
        self._ambient = thermal.ambient_c if thermal else 22.0
        self._loss = thermal.loss_w_nm2 if thermal else 0.0
        self._heating = 1.0 / thermal.capacity_j_k if thermal else 0.0
        self._cooling = 1.0 / (thermal.capacity_j_k * thermal.resistance_k_w) if thermal else 0.0
        self.kelvin = thermal.initial_c - thermal.ambient_c if thermal and thermal.initial_c is not None else 0.0
        """Temperature above ambient."""

    @property
    def temperature_c(self) -> float:
        return self._ambient + self.kelvin

    def torque(self, demand_nm: float, q: float) -> float:
        """Mean torque on the rotor over one period, N·m, with ``demand_nm`` given at its begin, near angle ``q``."""
        if self._delay is not None:
            demand_nm = self._delay.push(demand_nm)
        peak = self._peak
        demand_nm = peak if demand_nm > peak else -peak if demand_nm < -peak else demand_nm
        behind = self.current_nm - demand_nm
        mean = demand_nm + behind * self._mean_share
        self.current_nm = demand_nm + behind * self._decay
        torque = mean * self._gain
        if self._gain_per_kelvin:
            torque *= 1.0 + self._gain_per_kelvin * self.kelvin
        if self._ripple is not None:
            torque -= torque * self._ripple.at(q)
        if self._dead_zone:
            lost = self._dead_zone
            torque = torque - lost if torque > lost else torque + lost if torque < -lost else 0.0
        if self._saturation:
            torque = self._saturation * math.tanh(torque / self._saturation)
        return torque

    def warm(self, friction_power_w: float, h: float) -> None:
        """``h`` seconds of heating by the current and by friction."""
        if self._thermal:
            heat = self._loss * self.current_nm * self.current_nm + abs(friction_power_w)
            self.kelvin += h * (self._heating * heat - self._cooling * self.kelvin)


def phase_currents(
    law: Motor, torque_nm: float, q: float, noise: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Phase currents in A that Eq. 4.10 turns back into ``torque_nm``, with the sensors' own errors.

    τ = K_T·(I_a sin θ + I_b sin(θ + 120°) + I_c sin(θ + 240°)), θ the electrical angle pole_pairs·q.
    """
    amplitude = torque_nm / (1.5 * law.torque_constant_nm_a)
    theta = law.pole_pairs * q
    third = 2.0 * math.pi / 3.0
    a, b, c = (
        gain * amplitude * math.sin(theta + k * third) + offset + error
        for k, (gain, offset, error) in enumerate(zip(law.phase_gain, law.phase_offset_a, noise, strict=True))
    )
    return a, b, c
