"""Between a drive's integers and SI units at the joint."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from config.schema import Joint

_PERMILLE = 1000.0


@dataclass(frozen=True, slots=True)
class JointScale:
    """Affine scaling of one joint: counts of 6064/607A, counts/s of 606C/60B1, ‰ of rated torque of 6077/6071/60B2.

    The encoder's sign turns position, velocity and torque alike, so that power keeps its sign.
    """

    rad_per_count: float
    zero_rad: float
    nm_per_permille: float

    @classmethod
    def of(cls, joint: Joint) -> JointScale:
        sign = joint.encoder.sign
        return cls(
            rad_per_count=sign * 2.0 * pi / joint.encoder.counts_per_turn,
            zero_rad=joint.encoder.zero_rad,
            nm_per_permille=sign * joint.rated_torque_nm / _PERMILLE,
        )

    @property
    def feedback(self) -> tuple[float, float, float, float]:
        """(rad per count, zero in rad, rad/s per count/s, N·m per ‰): SI = raw · factor (+ zero)."""
        return self.rad_per_count, self.zero_rad, self.rad_per_count, self.nm_per_permille

    @property
    def command(self) -> tuple[float, float, float, float]:
        """(counts per rad, zero in rad, counts/s per rad/s, ‰ per N·m): raw = round((SI - zero) · factor)."""
        return 1.0 / self.rad_per_count, self.zero_rad, 1.0 / self.rad_per_count, 1.0 / self.nm_per_permille
