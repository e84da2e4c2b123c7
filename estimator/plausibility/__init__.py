"""Whether recordings can be what they are said to be: wrong units, signs, order of joints, arms; cut-off sensors."""

from estimator.plausibility.alike import contradicting
from estimator.plausibility.cut_off import cut_off, dead
from estimator.plausibility.doubt import Doubt, Kind
from estimator.plausibility.examine import (
    examine,
    examine_motion,
    without_dead_velocities,
    without_unusable_torques,
)
from estimator.plausibility.leaps import about, how_far, leaps, turns
from estimator.plausibility.poor_motion import missing_motions
from estimator.plausibility.times import check_times
from estimator.plausibility.wrench import readable_wrench

__all__ = [
    "Doubt",
    "Kind",
    "about",
    "check_times",
    "contradicting",
    "cut_off",
    "dead",
    "examine",
    "examine_motion",
    "how_far",
    "leaps",
    "missing_motions",
    "readable_wrench",
    "turns",
    "without_dead_velocities",
    "without_unusable_torques",
]
