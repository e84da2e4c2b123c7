"""Every disagreement of an installation with its drive file, EDS or URDF is one sentence with place and remedy."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from config import InputError, load_installation

Spoil = Callable[[str, str, str, str], Path]

MISTAKES = [
    (
        "etude402_tacho.toml",
        "product_code = 0x00000402",
        "product_code = 0x403",
        "etude402_tacho.toml: identity.product_code: 0x00000403 is not the drive of etude402.eds, which "
        "has 0x00000402; use the EDS of this drive, or correct the identity",
    ),
    (
        "etude402_tacho.toml",
        "index = 0x606C",
        "index = 0x606E",
        "etude402_tacho.toml: objects[3] (velocity): 606E:00 does not exist in etude402.eds; use the EDS of this drive",
    ),
    (
        "etude402_tacho.toml",
        "index = 0x606C",
        "index = 0x6085",
        "etude402_tacho.toml: objects[3] (velocity): 6085:00 is u32, not i32, in etude402.eds; use the "
        "EDS of this drive",
    ),
    (
        "etude402_tacho.toml",
        'index = 0x6041\ntype = "u16"',
        'index = 0x6066\ntype = "u16"',
        "etude402_tacho.toml: objects[1] (statusword): 6066:00 cannot be mapped into a PDO in "
        "etude402.eds; use the EDS of this drive",
    ),
    (
        "etude402_tacho.toml",
        'index = 0x6040\ntype = "u16"',
        'index = 0x603F\ntype = "u16"',
        "etude402_tacho.toml: objects[0] (controlword): 603F:00 is ro and cannot be mapped into an RPDO "
        "in etude402.eds; use the EDS of this drive",
    ),
    (
        "etude402_tacho.toml",
        "index = 0x2110",
        "index = 0x2111\nsubindex = 1",
        "etude402_tacho.toml: objects[9] (temperature): 2111:01 is i32, not i16, in etude402.eds; use the EDS of this "
        "drive",
    ),
    (
        "etude402_tacho.toml",
        'name = "temperature"',
        'name = "warmth"',
        "etude402_tacho.toml: temperature: object 'temperature' is not among objects; add an [[objects]]",
    ),
    (
        "etude402_tacho.toml",
        "tpdo = 4",
        "tpdo = 2",
        "etude402_tacho.toml: temperature.tpdo: TPDO 2 is that of layouts.csp; give a free one",
    ),
    (
        "etude402_tacho.toml",
        'tpdo = [["statusword", "position", "torque"], ["velocity"]]\n\n[layouts.cst]',
        'tpdo = [["statusword", "position", "torque"], ["velocity", "temperature"]]\n\n[layouts.cst]',
        "etude402_tacho.toml: layouts.csp.tpdo: maps 'temperature', which has a TPDO of its own; remove it",
    ),
    (
        "etude402_tacho.toml",
        "every = 240",
        "every = 1",
        "etude402_tacho.toml: temperature.every: 1 is out of range; give at least 2",
    ),
    (
        "etude402_tacho.toml",
        "index = 0x6080",
        "index = 0x6502",
        "etude402_tacho.toml: start_up[3]: 6502:00 is read-only in etude402.eds; remove it",
    ),
    (
        "etude402_tacho.toml",
        "index = 0x6080",
        "index = 0x6089",
        "etude402_tacho.toml: start_up[3]: 6089:00 is not in etude402.eds; remove or correct it",
    ),
    (
        "etude402_tacho.toml",
        '"servo_damping"',
        '"servo_damper"',
        "etude402_tacho.toml: start_up[1].from_key: 'servo_damper' is none of 'servo_stiffness', "
        "'servo_damping', 'torque_limit', 'velocity_limit', 'position_low', 'position_high' or "
        "'following_error'; choose one of them",
    ),
    (
        "etude402_tacho.toml",
        'from_key = "servo_damping"',
        "#",
        "etude402_tacho.toml: start_up[1].value: must stand alone or give way to from_key; give exactly one of the two",
    ),
    (
        "etude402_tacho.toml",
        '"target_torque"]]',
        '"traget_torque"]]',
        "etude402_tacho.toml: layouts.cst.rpdo[0]: object 'traget_torque' is not among objects; add an [[objects]]",
    ),
    (
        "etude402_tacho.toml",
        '"target_torque"]]',
        '"torque_offset"]]',
        "etude402_tacho.toml: layouts.cst.rpdo: mode cst needs the object 'target_torque'; map it",
    ),
    (
        "etude402_tacho.toml",
        '["velocity_offset"]',
        '["torque_offset"]',
        "etude402_tacho.toml: layouts.csp.rpdo[0]: object 'torque_offset' is mapped twice; map it once",
    ),
    (
        "etude402_tacho.toml",
        '"torque_offset"], [',
        '"torque_offset", ',
        "etude402_tacho.toml: layouts.csp.rpdo[0]: 96 bits are not 1 to 8 bytes; use another PDO",
    ),
    (
        "etude402_tacho.toml",
        'eds = "etude402.eds"',
        'eds = "other.eds"',
        "other.eds: cannot be read (No such file or directory); check eds of the drive",
    ),
    (
        "etude402.eds",
        "[FileInfo]",
        "FileInfo",
        "etude402.eds: is not an EDS file (line 1 is not understood); use the vendor's file",
    ),
    (
        "etude402.eds",
        "[1018]",
        "[1019]",
        "etude402.eds: is not an EDS file ('0x1018 was not found in Object Dictionary'); use the vendor's file",
    ),
    (
        "dda.urdf",
        "</robot>",
        "",
        "dda.urdf: is not XML (no element found: line 66, column 0); check arm.urdf",
    ),
    (
        "dda.urdf",
        'upper="5.0"',
        'upper="five"',
        "dda.urdf: joint 'joint3': limit upper='five' is no number; correct it",
    ),
    (
        "dda.urdf",
        '<joint name="flange" type="fixed">',
        '<joint name="flange" type="revolute">',
        "installation.toml: joint: flange of dda.urdf moves and has no drive; add a [[joint]], or fix it there",
    ),
    (
        "dda.urdf",
        '<joint name="joint3" type="revolute">',
        '<joint name="joint3" type="prismatic">',
        "installation.toml: joint[2].name: joint3 is prismatic in dda.urdf; configure turning joints only",
    ),
    (
        "dda.urdf",
        'mass value="67.13"',
        'mass value="67 kg"',
        "dda.urdf: link 'link1': its <mass value='67 kg'> is not a finite number; write SI units, without their names",
    ),
    (
        "dda.urdf",
        'mass value="67.13"',
        'mass value="nan"',
        "dda.urdf: link 'link1': its <mass value='nan'> is not a finite number; write SI units, without their names",
    ),
    (
        "dda.urdf",
        'mass value="67.13"',
        'mass value="-67.13"',
        "dda.urdf: link 'link1': its mass -67.13 kg is negative; correct it",
    ),
    (
        "dda.urdf",
        'axis xyz="0 0 1"',
        'axis xyz="0 0 0"',
        "dda.urdf: joint 'joint1': its axis is zero; give a direction",
    ),
    (
        "dda.urdf",
        'axis xyz="0 0 1"',
        'axis xyz="0 0"',
        "dda.urdf: joint 'joint1': its <axis xyz='0 0'> is not 3 finite numbers; write SI units, without their names",
    ),
]


@pytest.mark.parametrize(("file", "old", "new", "sentence"), MISTAKES, ids=[m[3][:70] for m in MISTAKES])
def test_mistake_is_named(spoilt: Spoil, file: str, old: str, new: str, sentence: str) -> None:
    path = spoilt("dda", file, old, new)
    with pytest.raises(InputError) as caught:
        load_installation(str(path))
    assert str(caught.value).replace(f"{path.parent}/", "") == sentence
    assert str(caught.value).startswith(f"{path.parent}/"), "the file is not named in full"


def test_an_arm_of_meshes_alone_has_nothing_to_hold_against_gravity(spoilt: Spoil) -> None:
    path = spoilt("dda", "dda.urdf", "<link", "<link")
    urdf = path.with_name("dda.urdf")
    urdf.write_text(re.sub(r"<inertial>.*?</inertial>", "", urdf.read_text(), flags=re.DOTALL))
    with pytest.raises(InputError, match=r"joint\[0\]\.name: nothing that joint1 moves has a mass in .*<inertial>"):
        load_installation(str(path))


def test_a_mark_before_utf_8_is_no_part_of_the_text(spoilt: Spoil) -> None:
    path = spoilt("dda", "installation.toml", "[arm]", "[arm]")
    path.write_text(path.read_text(), encoding="utf-8-sig")
    assert load_installation(str(path)).arm.name == "dda"
