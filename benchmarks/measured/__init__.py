"""Recordings that others measured, as what Étude reads: adaptors, one a data set, that convert on reading."""

from collections.abc import Callable
from functools import partial

from benchmarks.measured.dataset import MeasuredArm, is_here, write_files
from benchmarks.measured.emps import emps
from benchmarks.measured.kinova import kinova
from benchmarks.measured.kuka import kuka
from benchmarks.measured.odrive import cogging_map, odrive
from benchmarks.measured.panda import panda, whole_panda

ADAPTORS: dict[str, Callable[[], MeasuredArm]] = {
    "emps": emps,
    "franka_panda": panda,
    "kinova_gen3": kinova,
    "kuka_kr300": partial(kuka, "link"),
    "odrive_cogging": odrive,
}
"""By the folder of the data set."""

__all__ = [
    "ADAPTORS",
    "MeasuredArm",
    "cogging_map",
    "emps",
    "is_here",
    "kinova",
    "kuka",
    "odrive",
    "panda",
    "whole_panda",
    "write_files",
]
