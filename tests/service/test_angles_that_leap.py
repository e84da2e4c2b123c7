"""Recordings of angles that are told within one turn, or damaged, read as those of joints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from driver.recording import Recording
from estimator.rigid_body import RigidBody, load_rigid_body
from service.identification.continuous import continuous

Array = NDArray[np.float64]
TURN = 2.0 * np.pi
LINK = """<link name="{name}"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
URDF = f"""<robot name="arm"><link name="base"/>
<joint name="axle" type="continuous"><parent link="base"/><child link="first"/><axis xyz="0 0 1"/></joint>
{LINK.format(name="first")}
<joint name="slide" type="prismatic"><parent link="first"/><child link="second"/><axis xyz="0 0 1"/>
<limit lower="-20" upper="20" effort="1" velocity="1"/></joint>
{LINK.format(name="second")}</robot>"""


@pytest.fixture(scope="module")
def body() -> RigidBody:
    return load_rigid_body(URDF)


@pytest.fixture
def recorded() -> Callable[[float], Recording]:
    """Three turns of the axle from an angle on; the slide runs 8 m."""

    def make(begin: float) -> Recording:
        t = np.arange(3000) / 200.0
        q = np.column_stack([begin + 9.0 * np.sin(0.6 * t), 4.0 * np.sin(0.5 * t)])
        return Recording(Path("run.csv"), ("axle", "slide"), 0, t, q, None, np.zeros_like(q), q_d=q + 0.01)

    return make


def within_a_turn(recording: Recording) -> Recording:
    def told(q: Array | None) -> Array | None:
        return None if q is None else np.column_stack([(q[:, 0] + np.pi) % TURN - np.pi, q[:, 1]])

    q = told(recording.q)
    assert q is not None
    return replace(recording, q=q, q_d=told(recording.q_d), q_motor=told(recording.q_motor))


def test_angles_go_on_over_the_turn_that_they_are_told_within(
    body: RigidBody, recorded: Callable[[float], Recording]
) -> None:
    """In the same turn in all recordings, as desired and as the motor has it too."""
    true = [replace(r, q_motor=r.q - 0.002) for r in (recorded(0.5), recorded(3.0))]
    still = replace(true[0], q=np.tile([3.3, 0.0], (3000, 1)), q_d=None, q_motor=None)
    mended, notes = continuous([within_a_turn(r) for r in (*true, still)], body)
    assert notes == ["the angle of axle is told within one turn: it is taken as going on over it"]
    turned = TURN * np.round((mended[0].q[0, 0] - true[0].q[0, 0]) / TURN)
    for found, own in zip(mended, (*true, still), strict=True):
        for name in ("q", "q_d", "q_motor"):
            was, now = getattr(own, name), getattr(found, name)
            if was is not None:
                np.testing.assert_allclose(now - [turned, 0.0], was, atol=1e-9)


def test_recordings_that_go_on_already_stay_as_they_are(
    body: RigidBody, recorded: Callable[[float], Recording]
) -> None:
    """Also where one is a turn away from the other."""
    own = [recorded(0.0), recorded(TURN)]
    mended, notes = continuous(own, body)
    assert notes == []
    for found, was in zip(mended, own, strict=True):
        np.testing.assert_array_equal(found.q, was.q)


@pytest.mark.parametrize(("column", "sample", "size", "unit"), [(0, 524, 0.4, "rad"), (1, 628, TURN, "m")])
def test_what_lies_about_a_leap_is_left_out(
    body: RigidBody, recorded: Callable[[float], Recording], column: int, sample: int, size: float, unit: str
) -> None:
    """Where each joint turns round; a slide has no turns."""
    own = recorded(0.0)
    own.q[sample, column] += size
    (mended,), (note,) = continuous([own], body)
    assert note.startswith(f"run.csv: {own.joints[column]} leaps 2 times from one sample to the next")
    assert f"farthest by {size:.2g} {unit} at {own.t[sample]:.2f} s" in note
    missing = np.isnan(mended.q).all(axis=1)
    assert missing[sample]
    assert 4 < missing.sum() < 20
    assert np.isfinite(own.q).all()


def test_an_angle_that_leaps_all_the_time_is_refused_in_a_sentence(
    body: RigidBody, recorded: Callable[[float], Recording]
) -> None:
    own = recorded(0.0)
    own.q[100::100, 0] += 0.4
    with pytest.raises(InputError, match=r"run\.csv: axle leaps 58 times .* by 0\.4 rad at 0\.50 s"):
        continuous([own], body)


def test_leaps_are_told_by_the_farthest(body: RigidBody, recorded: Callable[[float], Recording]) -> None:
    """A sample that repeats the one before it, on a way so far that this is a leap, is as far off as the joint went."""
    own = recorded(0.0)
    own.q[:, 1] *= 60.0
    own.q[40, 1] = own.q[39, 1]
    _, (note,) = continuous([own], body)
    assert f"slide leaps 2 times from one sample to the next, farthest by 0.6 m at {own.t[40]:.2f} s" in note
    own.q[700, 1] += 20.0
    _, (note,) = continuous([own], body)
    assert f"slide leaps 4 times from one sample to the next, farthest by 20 m at {own.t[700]:.2f} s" in note
