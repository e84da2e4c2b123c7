"""One linear axis: motor, ball screw, carriage (Janot, Gautier, Brunot 2019)."""

from __future__ import annotations

from scipy.io import loadmat

from benchmarks.measured.dataset import MeasuredArm, data_folder
from estimator import Trajectory

FOLDER = "emps"
URDF = """<robot name='emps'>
<link name='rail'/>
<link name='carriage'/>
<joint name='axis' type='prismatic'><parent link='rail'/><child link='carriage'/><axis xyz='1 0 0'/>
<limit lower='-0.05' upper='0.3' velocity='0.5' effort='400'/></joint>
</robot>
"""


def emps() -> MeasuredArm:
    """Angles stand for metres and torques for newtons: force = gtau · motor voltage, both as measured; the velocity is
    not measured. The pulses are forces added to the controller's; the voltage holds them."""
    return MeasuredArm(
        "emps",
        URDF,
        {"emps": _recording("DATA_EMPS.mat"), "emps_pulses": _recording("DATA_EMPS_PULSES.mat")},
        held_out=("emps_pulses",),
    )


def _recording(file: str) -> Trajectory:
    data = loadmat(data_folder(FOLDER) / file)
    force = float(data["gtau"].squeeze()) * data["vir"]
    return Trajectory(data["t"].ravel(), data["qm"], force, q_desired=data["qg"], name=file)
