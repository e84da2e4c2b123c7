"""Every mistake in an installation file is one sentence that names file, key and remedy."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from config import InputError, load_installation

Spoil = Callable[[str, str, str, str], Path]

MISTAKES = [
    (
        "rate_hz = 1000",
        "rate_hz = = 1000",
        "installation.toml, line 14, column 11: is not TOML: invalid value; correct that line",
    ),
    (
        "rate_hz = 1000",
        "rate_hz = 1000\nrate_hz = 500",
        "installation.toml, line 15, column 14: is not TOML: cannot overwrite a value; correct that line",
    ),
    (
        "heartbeat_ms = 20",
        "hartbeat_ms = 20",
        "installation.toml: cycle.hartbeat_ms: is not a key of this section; did you mean 'heartbeat_ms'?",
    ),
    (
        "limits = { position_rad",
        "limits = { position_deg",
        "installation.toml: joint[0].limits.position_deg (joint1): is not a key of this section (1 more "
        "mistake, at joint[0].limits.position_rad (joint1)); did you mean 'position_rad'?",
    ),
    (
        "urdf = ",
        "#",
        "installation.toml: arm.urdf: is missing; add the key 'urdf'",
    ),
    (
        "[cycle]\nrate_hz = 1000\nheartbeat_ms = 20",
        "",
        "installation.toml: cycle: is missing; add the table 'cycle'",
    ),
    (
        "rate_hz = 1000",
        "rate_hz = 5000",
        "installation.toml: cycle.rate_hz: 5000 is out of range; give at most 4000",
    ),
    (
        "rate_hz = 1000",
        'rate_hz = "fast"',
        "installation.toml: cycle.rate_hz: is the text 'fast' where a number is wanted; write a number, without quotes",
    ),
    (
        "rate_hz = 1000",
        'rate_hz = "1000"',
        "installation.toml: cycle.rate_hz: is the text '1000' where a number is wanted; write a number, without quotes",
    ),
    (
        "position_rad = [0.2, 6.1]",
        'position_rad = [0.2, "6.1"]',
        "installation.toml: joint[0].limits.position_rad[1] (joint1): is the text '6.1' where a number is wanted; "
        "write a number, without quotes",
    ),
    (
        "heartbeat_ms = 20",
        "heartbeat_ms = true",
        "installation.toml: cycle.heartbeat_ms: must be a valid integer, not True; correct the value",
    ),
    (
        "rate_hz = 1000",
        "rate_hz = nan",
        "installation.toml: cycle.rate_hz: must be a finite number, not nan; correct the value",
    ),
    (
        "node_id = 2",
        "node_id = 128",
        "installation.toml: joint[1].node_id (joint2): 128 is out of range; give at most 127",
    ),
    (
        "local:dda-can0",
        "tcp:dda-can0",
        "installation.toml: bus[0].channel (can0): 'tcp:dda-can0' does not match "
        "^(socketcan|local):\\S+$; use a value of that form",
    ),
    (
        "local:dda-can1",
        "local:dda-can0",
        "installation.toml: bus[1].channel (can1): 'local:dda-can0' is used twice; give each its own",
    ),
    (
        '[[bus]]\nname = "can1"',
        '[[bus]]\nname = "can0"',
        "installation.toml: bus[1].name (can0): 'can0' is the name of bus[0] too; rename one of them",
    ),
    (
        'name = "joint2"\nbus = "can1"\nnode_id = 2',
        'name = "joint1"\nbus = "can1"\nnode_id = 2',
        "installation.toml: joint[1].name (joint1): 'joint1' is the name of joint[0] too; rename one of them",
    ),
    (
        'name = "joint2"\nbus = "can1"\nnode_id = 2',
        'name = "joint2"\nbus = "can9"\nnode_id = 2',
        "installation.toml: joint[1].bus (joint2): 'can9' is not a bus; known are can0, can1, can2",
    ),
    (
        'name = "joint2"\nbus = "can1"\nnode_id = 2',
        'name = "joint2"\nbus = "can0"\nnode_id = 1',
        "installation.toml: joint[1].node_id (joint2): node 1 on can0 is already joint1; give each drive "
        "on a bus a node number of its own",
    ),
    (
        "position_rad = [0.2, 6.1]",
        "position_rad = [6.1, 0.2]",
        "installation.toml: joint[0].limits.position_rad (joint1): the lower limit 6.1 is not below the "
        "upper limit 0.2; write [lower, upper]",
    ),
    (
        "position_rad = [0.2, 6.1]",
        "position_rad = [0.2]",
        "installation.toml: joint[0].limits.position_rad (joint1): has no value number 2; give as many as are wanted",
    ),
    (
        "[0.2, 6.1]",
        "[0.2, 7.0]",
        "installation.toml: joint[0].limits.position_rad (joint1): [0.2, 7.0] goes beyond [0.0, 6.2832] "
        "of dda.urdf; narrow it, or correct the URDF",
    ),
    (
        "torque_nm = 660.0",
        "torque_nm = 661.0",
        "installation.toml: joint[0].limits.torque_nm (joint1): 661 is more than the 660 of dda.urdf; lower it",
    ),
    (
        "velocity_rad_s = 10.0",
        "velocity_rad_s = 13",
        "installation.toml: joint[0].limits.velocity_rad_s (joint1): 13 is more than the 12 of dda.urdf; lower it",
    ),
    (
        "home_rad = [3.5779, ",
        "home_rad = [",
        "installation.toml: arm.home_rad: 2 angles for 3 joints; give one angle a joint",
    ),
    (
        "home_rad = [3.5779",
        "home_rad = [6.2",
        "installation.toml: arm.home_rad[0]: 6.2 rad is outside joint1's limits [0.2, 6.1]; move it inside",
    ),
    (
        'urdf = "dda.urdf"',
        'urdf = "nda.urdf"',
        "nda.urdf: cannot be read (No such file or directory); check arm.urdf",
    ),
    (
        'tool_frame = "tool"',
        'tool_frame = "tol"',
        "installation.toml: arm.tool_frame: dda.urdf has no link 'tol'; did you mean 'tool'?",
    ),
    (
        'frame = "tool"\nrate',
        'frame = "wrst"\nrate',
        "installation.toml: wrench_sensor[0].frame: dda.urdf has no link 'wrst'; known are base, link1, "
        "link2, link3, tool",
    ),
    (
        'name = "joint2"',
        'name = "joint5"',
        "installation.toml: joint[1].name: dda.urdf has no movable joint 'joint5'; did you mean 'joint3'?",
    ),
    (
        '"etude402_tacho"',
        '"etude402_taco"',
        "installation.toml: joint[0].drive: there is no drive 'etude402_taco'; did you mean 'etude402_tacho'?",
    ),
    (
        "rate_hz = 240",
        "rate_hz = 1300",
        "installation.toml: wrench_sensor[0].rate_hz (wrist): 1300 Hz is more than the 1000 Hz of bota "
        "at 460800 baud; give at most 1000",
    ),
    (
        'protocol = "bota"',
        'protocol = "robotiq"',
        "installation.toml: wrench_sensor[0].rate_hz (wrist): 240 Hz is more than the 100 Hz of robotiq "
        "at 19200 baud; give at most 100",
    ),
    (
        'protocol = "bota"',
        'protocol = "ati"',
        "installation.toml: wrench_sensor[0].protocol (wrist): 'ati' is none of 'bota' or 'robotiq'; "
        "choose one of them",
    ),
    (
        "rate_hz = 240",
        "rate_hz = 40",
        "installation.toml: wrench_sensor[0].stale_ms (wrist): 20 ms is shorter than one sample at 40 "
        "Hz, so each would be stale; give at least 75",
    ),
    (
        "[[wrench_sensor]]",
        "[wrench_sensor]",
        "installation.toml: wrench_sensor: must be a list; for tables write [[wrench_sensor]] above each",
    ),
    (
        "rate_hz = 1000",
        "rate_hz = 2000",
        "installation.toml: bus[0] (can0): the frames of a cycle in mode csp do not fit: SYNC 55 + "
        "joint1 RPDO1 135 + joint1 RPDO2 95 + joint1 TPDO1 135 + joint1 TPDO2 95 + joint1 TPDO4 0.3125 "
        "+ heartbeats 3.25 = 518.6 µs of 500 µs (104 %); use more buses, cycle.rate_hz of at most 1920, or shorter "
        "PDOs",
    ),
    (
        "[arm]",
        "drives = 1\n[arm]",
        "installation.toml: drives: is not a key of this section; remove it",
    ),
    (
        "rated_torque_nm = 66.0",
        "rated_torque_nm = 6.6",
        "installation.toml: joint[0] (joint1): torque_limit becomes 100000 in object 6072:00 of "
        "etude402_tacho, which takes 0 to 10000; correct the joint's settings or the drive's scale",
    ),
]


@pytest.mark.parametrize(("old", "new", "sentence"), MISTAKES, ids=[m[2][:70] for m in MISTAKES])
def test_mistake_is_named(spoilt: Spoil, old: str, new: str, sentence: str) -> None:
    path = spoilt("dda", "installation.toml", old, new)
    with pytest.raises(InputError) as caught:
        load_installation(str(path))
    assert str(caught.value).replace(f"{path.parent}/", "") == sentence
    assert str(caught.value).startswith(f"{path.parent}/"), "the file is not named in full"


def test_joints_are_ordered_from_the_base(spoilt: Spoil) -> None:
    path = spoilt("dda", "installation.toml", 'name = "joint2"', 'name = "joint0"')
    text = path.read_text().replace('name = "joint3"', 'name = "joint2"').replace('"joint0"', '"joint3"')
    path.write_text(text)
    with pytest.raises(InputError, match=r"joint\[1\]\.name: joint3 comes before joint2, which carries it"):
        load_installation(str(path))


def test_unknown_arm_lists_the_known_ones() -> None:
    with pytest.raises(InputError, match=r"arm 'pumas': is not one of dda, puma600, seven; name one"):
        load_installation("pumas")


def test_absent_and_unreadable_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.toml: there is no such file"):
        load_installation(str(tmp_path / "nowhere.toml"))
    latin = tmp_path / "latin.toml"
    latin.write_bytes('description = "Étude"'.encode("latin-1"))
    with pytest.raises(InputError, match=r"latin\.toml: is not UTF-8 text \(byte 15\)"):
        load_installation(str(latin))
    with pytest.raises(InputError, match=r"cannot be read \(it is no file\)"):
        load_installation(f"{tmp_path}/")


def test_input_error_survives_a_process_boundary() -> None:
    import pickle

    error = InputError("a.toml: key", "is wrong", "mend it")
    assert str(pickle.loads(pickle.dumps(error))) == str(error) == "a.toml: key: is wrong; mend it"
