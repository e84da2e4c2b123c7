"""Motions that tell the most about what is still uncertain, within an arm's limits."""

from estimator.excitation.basis import MotionBasis, fourier_basis, polynomial_basis
from estimator.excitation.d_optimal import DesignedMotion, design, judge, random_motion
from estimator.excitation.information import Information
from estimator.excitation.limits import MotionLimits

__all__ = [
    "DesignedMotion",
    "Information",
    "MotionBasis",
    "MotionLimits",
    "design",
    "fourier_basis",
    "judge",
    "polynomial_basis",
    "random_motion",
]
