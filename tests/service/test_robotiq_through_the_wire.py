"""A two-joint arm with a Robotiq FT 300, described in a folder of its own: commissioned, moved, recorded, unplugged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from driver.recording import Recording, read_recording
from driver.recording import replay as replay_file

pytestmark = pytest.mark.timeout(600)

URDF = """
<robot name="elbow">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="6"/>
  <inertia ixx="0.02" iyy="0.09" izz="0.09" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="fore"><inertial><origin xyz="0.15 0 0"/><mass value="3"/>
  <inertia ixx="0.01" iyy="0.03" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="flange"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.5"/>
  <axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="3" effort="80"/></joint>
<joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0.4 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" velocity="4" effort="40"/></joint>
<joint name="wrist" type="fixed"><parent link="fore"/><child link="flange"/><origin xyz="0.3 0 0"/></joint>
</robot>
"""
JOINT = """
[[joint]]
name = "{name}"
bus = "can0"
node_id = {node}
drive = "etude402_encoder"
rated_torque_nm = {torque}
encoder = {{ counts_per_turn = 262144, sign = 1, zero_rad = 0.0 }}
limits = {{ position_rad = [-2.0, 2.0], velocity_rad_s = 3.0, acceleration_rad_s2 = 30.0, torque_nm = {most}, \
torque_rate_nm_s = 30000.0 }}
servo = {{ stiffness_nm_rad = {k}, damping_nms_rad = {d} }}
digital = {{ stiffness_nm_rad = {k}, damping_nms_rad = {d} }}
"""
INSTALLATION = (
    """
[arm]
name = "elbow"
urdf = "elbow.urdf"
tool_frame = "flange"
home_rad = [0.0, 0.5]
[cycle]
rate_hz = 500
heartbeat_ms = 20
[[bus]]
name = "can0"
channel = "local:elbow-can0"
[[wrench_sensor]]
name = "wrist"
protocol = "robotiq"
port = "pty:elbow-wrist"
frame = "flange"
rate_hz = 100
range_n = 300.0
range_nm = 30.0
[virtual]
"""
    + JOINT.format(name="shoulder", node=1, torque=40.0, most=80.0, k=1200, d=60)
    + JOINT.format(name="elbow", node=2, torque=20.0, most=40.0, k=120, d=6)
)
MASS, CENTRE = 1.2, np.array([0.03, -0.02, 0.05])
BIAS = np.array([3.0, -2.0, 1.0, 0.05, -0.1, 0.02])
"""Of the sensor, N and N·m: nobody has zeroed it."""
HIDDEN = f"""
[payload]
mass_kg = {MASS}
centre_m = {CENTRE.tolist()}
inertia_kg_m2 = [0.002, 0.0, 0.0, 0.002, 0.0, 0.002]
[[wrench_sensor]]
sensor = "wrist"
bias = {BIAS.tolist()}
force_noise = {{ white = 0.002 }}
"""
POSES = [[0.0, 0.5], [-0.6, 1.4], [0.2, -0.9]]
MOTION = f"""
kind = "polynomial"
way_points_rad = {POSES}
duration_s = [0.8, 1.5]
dwell_s = 0.8
"""
UNPLUGGED_MS, AWAY_MS = 2100.0, 300.0
"""In the middle of the second movement, until before its end."""
FAULTS = f"""
[[fault]]
kind = "wrench_gone"
sensor = "wrist"
delay_ms = {UNPLUGGED_MS}
duration_ms = {AWAY_MS}
"""


@pytest.fixture
def arm(house: Any) -> str:
    """The arm's installation file, with everything it takes beside it."""
    texts = {"elbow.urdf": URDF, "hidden.toml": HIDDEN, "poses.toml": MOTION, "faults.toml": FAULTS}
    for name, text in {**texts, "installation.toml": INSTALLATION}.items():
        (house.folder / name).write_text(text)
    return str(house.folder / "installation.toml")


def held_up(pose: np.ndarray) -> np.ndarray:
    """What the sensor exerts on the resting load, in the tool's frame: its weight, turned by both joints about y."""
    angle = float(pose.sum())
    force = MASS * 9.81 * np.array([-np.sin(angle), 0.0, np.cos(angle)])
    return np.concatenate((force, np.cross(CENTRE, force)))


def at_rest(recording: Recording, pose: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
    """Mean measured angles and wrench while the arm has been told to stand at this pose for 0.3 s.

    It does not stand there quite: the servos in the drives give under the load.
    """
    assert recording.q_d is not None and recording.wrench is not None and recording.wrench_t is not None
    told = np.abs(recording.q_d - pose).max(axis=1) < 1e-3
    times = recording.t[told]
    first = times[0] + 0.3
    stands = (recording.wrench_t > first) & (recording.wrench_t < times[-1])
    assert np.diff(times).max() < 0.01, "it stands there once"
    assert stands.sum() >= 20, "at 100 Hz"
    return recording.q[told][times > first].mean(axis=0), recording.wrench[stands].mean(axis=0)


def test_commissioned_weighed_unplugged_and_taken_up_again(house: Any, start: Any, arm: str) -> None:
    beside = {name: str(house.folder / f"{name}.toml") for name in ("hidden", "faults", "poses")}
    stand_in = ("--hidden", beside["hidden"], "--faults", beside["faults"])
    start("virtual", "--config", arm, "--lockstep", *stand_in)
    start("daemon", "--config", arm, "--lockstep")

    answer = house.answer("run", beside["poses"], "--arm", arm)
    path = Path(answer["recording"])
    recording = read_recording(path)
    assert answer["silent_sensors"] == {"wrist": "its line is gone"}
    assert recording.wrench_t is not None
    assert recording.wrench_frame == "flange"
    steps = np.diff(recording.wrench_t)
    assert np.median(steps) == pytest.approx(0.01, rel=0.02), "an FT 300 streams at 100 Hz"
    assert steps.max() < 0.015, "and nothing is missing until it is gone"
    stood, wrench = at_rest(recording, POSES[1])
    np.testing.assert_allclose(wrench - BIAS, held_up(stood), atol=0.02)
    assert recording.wrench_t[-1] < recording.t[-1] - 1.0, "what was unplugged is not made up"
    assert any("wrench sensor wrist: its line" in event.text and "is gone" in event.text for event in recording.events)
    assert np.isfinite(recording.q).all(), "the arm has gone on to the motion's end"
    assert replay_file(path).identical

    (told,) = (x for x in house.etude("status", "--arm", arm).stdout.splitlines() if x.startswith("sensor wrist"))
    assert told.endswith("stale: its line is gone")

    answer = house.answer("run", beside["poses"], "--arm", arm)
    assert answer["silent_sensors"] == {}
    again = read_recording(Path(answer["recording"]))
    for pose in POSES[1:]:
        stood, wrench = at_rest(again, pose)
        np.testing.assert_allclose(wrench - BIAS, held_up(stood), atol=0.02)
    (sensor,) = house.answer("status", "--arm", arm)["sensors"]
    assert (sensor["name"], sensor["stale"], sensor["condition"]) == ("wrist", False, "valid")
