"""What a load weighs, where its centre is, how it resists turning: by wrenches at the wrist, or by joint torques."""

from estimator.loads.estimate import LoadEstimate
from estimator.loads.identification import LoadOptions, Tare, identify_load
from estimator.loads.parameters import RigidLoad, rigid_load
from estimator.loads.recognition import recognise, verify
from estimator.loads.recording import LoadRecording, align_wrench
from estimator.loads.recursive import RecursiveLoad
from estimator.loads.static import identify_static_load

__all__ = [
    "LoadEstimate",
    "LoadOptions",
    "LoadRecording",
    "RecursiveLoad",
    "RigidLoad",
    "Tare",
    "align_wrench",
    "identify_load",
    "identify_static_load",
    "recognise",
    "rigid_load",
    "verify",
]
