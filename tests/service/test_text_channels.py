"""Recordings as one text file a channel: read in place, faults named by file and line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config import InputError
from config.loader import HERE
from service.demo.real_arm import DATA, PUBLISHED_RELATIVE_ERROR, URDF
from service.identification.links import identify
from service.identification.request import LinksRequest
from service.identification.text_channels import is_text_channels, read_text_channels

JOINTS = ("a", "b")


@pytest.fixture
def channels(tmp_path: Path) -> Path:
    rows = np.arange(20.0)
    for name, values in {
        "time": rows * 0.001 + 7.0,
        "positions": np.column_stack([rows, -rows]).ravel(),
        "velocity": np.ones(40),
        "torques": np.zeros(40),
    }.items():
        (tmp_path / f"motion_{name}.txt").write_text("\n".join(str(x) for x in values) + "\n")
    return tmp_path


def test_channels_become_samples_of_joints(channels: Path) -> None:
    assert is_text_channels(channels)
    recording = read_text_channels(channels, JOINTS)
    np.testing.assert_allclose(recording.t, np.arange(20) * 0.001, atol=1e-12)
    np.testing.assert_array_equal(recording.q[3], [3.0, -3.0])
    assert recording.joints == JOINTS


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("torques", "0.0\n", "", "has 39 numbers for 20 samples of 2 joints"),
        ("positions", "3.0\n", "three\n", "line 7 is no number"),
        ("velocity", "1.0\n", "nan\n", "number 1 is nan"),
        ("time", "7.003\n", "6.5\n", "line 4: time does not rise"),
    ],
)
def test_faults_are_named(name: str, old: str, new: str, said: str, channels: Path) -> None:
    path = channels / f"motion_{name}.txt"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=said) as caught:
        read_text_channels(channels, JOINTS)
    assert path.name in str(caught.value)


def test_a_missing_channel_is_named(channels: Path) -> None:
    (channels / "motion_torques.txt").unlink()
    with pytest.raises(InputError, match=r"\*_torques\.txt"):
        read_text_channels(channels, JOINTS)


def test_a_real_arm_is_identified_from_its_text_channels(tmp_path: Path) -> None:
    if not DATA.is_dir():
        pytest.skip(f"the recording of the Franka Panda is not at {DATA.relative_to(HERE.parent.parent)}")
    answer = identify(LinksRequest((DATA,), tmp_path, arm=str(URDF))).answer
    assert answer["status"] == "identified"
    assert len(answer["base_parameters"]) == 43
    assert answer["relative_error"] < PUBLISHED_RELATIVE_ERROR
