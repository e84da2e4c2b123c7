"""Small arms of the tests' own: a pendulum, and two joints with a wrist sensor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from config import Installation, load_installation
from virtual_hw.hidden import parse_hidden
from virtual_hw.plant import Plant, build_plant

PENDULUM = """
<robot name="pendulum">
  <link name="base"/>
  <link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="2.0"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <joint name="swing" type="continuous"><parent link="base"/><child link="rod"/>
    <origin xyz="0 0 1"/><axis xyz="0 1 0"/></joint>
</robot>
"""
TWO_JOINTS = """
<robot name="two">
  <link name="base"/>
  <link name="turret"><inertial><mass value="5.0"/>
    <inertia ixx="0.2" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
  <link name="arm"><inertial><origin xyz="0.2 0 0"/><mass value="3.0"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.08" iyz="0" izz="0.08"/></inertial></link>
  <link name="wrist"><inertial><origin xyz="0 0 0.05"/><mass value="0.5"/>
    <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="turret"/><axis xyz="0 0 1"/></joint>
  <joint name="lift" type="continuous"><parent link="turret"/><child link="arm"/>
    <origin xyz="0 0 0.5"/><axis xyz="0 1 0"/></joint>
  <joint name="mount" type="fixed"><parent link="arm"/><child link="wrist"/><origin xyz="0.4 0 0"/></joint>
</robot>
"""

MakePlant = Callable[..., Plant]


def _installation(
    folder: Path, urdf: str, tool: str, home: dict[str, float], sensors: list[dict[str, object]]
) -> Installation:
    (folder / "arm.urdf").write_text(urdf)
    dda = load_installation("dda")
    joint = dda.joint[0].model_dump() | {"bus": "can0", "rated_torque_nm": 100.0}
    joint["encoder"] = {"counts_per_turn": 1_000_000}
    joint["limits"] = {
        "position_rad": (-10.0, 10.0),
        "velocity_rad_s": 20.0,
        "acceleration_rad_s2": 100.0,
        "torque_nm": 100.0,
        "torque_rate_nm_s": 1e5,
    }
    return Installation.model_validate(
        {
            "arm": {"name": "test", "urdf": "arm.urdf", "tool_frame": tool, "home_rad": tuple(home.values())},
            "cycle": {"rate_hz": 1000},
            "bus": [{"name": "can0", "channel": "local:can0"}],
            "joint": [joint | {"name": name, "node_id": k} for k, name in enumerate(home, 1)],
            "wrench_sensor": sensors,
            "path": folder / "installation.toml",
            "drives": {name: drive.model_dump() for name, drive in dda.drives.items()},
        }
    )


@pytest.fixture
def pendulum(tmp_path: Path) -> Installation:
    """One joint about y, 2 kg at 0.5 m, 0.6 kg m² about the axis; q = 0 stretches along x."""
    return _installation(tmp_path, PENDULUM, "rod", {"swing": 0.0}, [])


@pytest.fixture
def two_joints(tmp_path: Path) -> Installation:
    """A turret about z, an arm about y, and a wrist sensor in link ``wrist``."""
    sensor = {
        "name": "wrist",
        "protocol": "bota",
        "port": "pty:wrist",
        "frame": "wrist",
        "rate_hz": 800,
        "range_n": 200.0,
        "range_nm": 10.0,
    }
    return _installation(tmp_path, TWO_JOINTS, "wrist", {"turn": 0.3, "lift": -0.4}, [sensor])


@pytest.fixture
def make_pendulum(pendulum: Installation) -> MakePlant:
    """A pendulum with the hidden mechanics of a TOML text."""

    def make(hidden: str = "", seed: int = 1, home: float = 0.0, gravity: bool = True) -> Plant:
        arm = pendulum.arm.model_copy(
            update={"home_rad": (home,), "gravity_m_s2": (0.0, 0.0, -9.81 if gravity else 0.0)}
        )
        installation = pendulum.model_copy(update={"arm": arm})
        return build_plant(installation, parse_hidden(hidden, installation), seed)

    return make
