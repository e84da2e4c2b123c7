"""Motions: typed files, curves with analytic derivatives, samples at the loop's rate, and the check against the limits.

A motion goes ``load_motion`` → ``sample`` → ``check_motion`` → a plan of the driver.
"""

from config.motion.curves import Curve
from config.motion.files import Motion, known_motions, load_motion
from config.motion.limits import check_motion, fitting_duration, point_to_point
from config.motion.sampled import SampledMotion, sample

__all__ = [
    "Curve",
    "Motion",
    "SampledMotion",
    "check_motion",
    "fitting_duration",
    "known_motions",
    "load_motion",
    "point_to_point",
    "sample",
]
