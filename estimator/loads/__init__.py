"""What a load weighs, where its centre is, how it resists turning: by wrenches at the wrist, or by joint torques."""

from estimator.loads.estimate import LoadEstimate
from estimator.loads.history import WrenchHistory, wrench_history
from estimator.loads.identification import LoadOptions, identify_load
from estimator.loads.live import LiveLoad
from estimator.loads.parameters import RigidLoad, rigid_load
from estimator.loads.poses import resting_poses
from estimator.loads.recognition import recognise, verify
from estimator.loads.recording import LoadRecording, align_wrench
from estimator.loads.recursive import RecursiveLoad
from estimator.loads.static import StaticLoad, identify_static_load
from estimator.loads.tare import Tare, tare

__all__ = [
    "LiveLoad",
    "LoadEstimate",
    "LoadOptions",
    "LoadRecording",
    "RecursiveLoad",
    "RigidLoad",
    "StaticLoad",
    "Tare",
    "WrenchHistory",
    "align_wrench",
    "identify_load",
    "identify_static_load",
    "recognise",
    "resting_poses",
    "rigid_load",
    "tare",
    "verify",
    "wrench_history",
]
