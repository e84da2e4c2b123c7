"""An arm that stands outside its limits: not enabled there, and brought back by `etude return`."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config import InputError, Installation, load_installation
from driver.cyclic.cycle import LoopState
from driver.cyclic.gate import Gate
from service.return_inside import FARTHEST_RAD, SLOWER, outside, reaching

DDA = load_installation("dda")
HOME = np.array(DDA.arm.home_rad)


def at(joint: int, angle: float) -> np.ndarray:
    q = HOME.copy()
    q[joint] = angle
    return q


@pytest.mark.parametrize(("angle", "inward"), [(6.1 + 0.3, -1), (0.2 - 0.3, 1)])
def test_what_is_outside_is_named_with_where_it_goes(angle: float, inward: int) -> None:
    (one,) = outside(DDA, at(0, angle))
    assert one.joint == "joint1" and "0.3 beyond" in str(one)
    low, high = DDA.joint[0].limits.position_rad
    assert low < one.to < high and np.sign(one.to - one.stands) == inward
    assert outside(DDA, HOME) == []


def test_the_way_back_is_slow_and_no_longer_than_to_where_the_joint_stands() -> None:
    wide = reaching(DDA, at(0, 6.4))
    assert wide.joint[0].limits.position_rad == (0.2, pytest.approx(6.42))
    assert [j.limits.position_rad for j in wide.joint[1:]] == [j.limits.position_rad for j in DDA.joint[1:]]
    for slow, joint in zip(wide.joint, DDA.joint, strict=True):
        assert slow.limits.velocity_rad_s == SLOWER * joint.limits.velocity_rad_s
        assert slow.limits.torque_nm == joint.limits.torque_nm
    gate, zero, off = Gate(wide), [0.0] * 3, [0] * 3
    q = at(0, 6.4).tolist()
    assert gate.check(LoopState.IDLE, off, q, zero, zero, q, zero, off, position_is_sent=True) is None
    for further in (6.43, 6.4 + 2 * SLOWER * 10.0 / 1000):
        moved = [further, *q[1:]]
        enabled = [0x0F] * 3
        refusal = gate.check(LoopState.PLAYING, enabled, moved, zero, zero, q, zero, off, position_is_sent=True)
        assert refusal is not None and refusal.joint == "joint1"


def test_a_joint_too_far_outside_is_left_alone() -> None:
    with pytest.raises(InputError, match=r"joint1 stands at 6\.7.*zero_rad"):
        reaching(DDA, at(0, 6.1 + FARTHEST_RAD + 0.1))


@pytest.fixture
def narrowed(house: Any) -> Path:
    """The arm with a limit of joint 2 below where its stand-in begins."""
    path: Path = house.arm_files()
    text = path.read_text()
    text = text.replace("position_rad = [0.0, 5.5]", "position_rad = [0.0, 2.5]").replace("2.6896", "2.0")
    path.write_text(re.sub(r"identification_motions = .*\n", "identification_motions = []\n", text))
    narrow: Installation = load_installation(str(path))
    assert outside(narrow, HOME)
    return path


def test_an_arm_outside_its_limits_is_not_enabled_and_comes_back(
    house: Any, narrowed: Path, start: Callable[..., Any], tmp_path: Path
) -> None:
    motion = tmp_path / "inside.toml"
    motion.write_text('kind = "polynomial"\nway_points_rad = [[3.5, 2.0, 1.7], [3.4, 2.1, 1.6]]\nduration_s = [0.5]\n')
    start("virtual")
    daemon = start("daemon", "--config", str(narrowed), "--lockstep")
    refused = house.etude("run", str(motion))
    assert refused.returncode == 2
    assert (
        "joint2 stands at 2.69 rad, outside its limits 0 to 2.5" in refused.stderr and "etude return" in refused.stderr
    )
    assert house.answer("status")["state"] == "idle", "nothing was latched, nothing moved"
    assert house.etude("return", "--arm", str(narrowed)).returncode == 2, "not beside a daemon"
    daemon.stop()

    came = house.answer("return", "--arm", str(narrowed))
    assert [one["joint"] for one in came["brought_inside"]] == ["joint2"]
    assert abs(came["q"][1] - 2.45) < 0.02
    assert np.abs(np.delete(came["q"], 1) - np.delete(HOME, 1)).max() < 0.02, "the others were held"
    start("daemon", "--config", str(narrowed), "--lockstep")
    assert house.answer("run", str(motion))["samples"] > 0
