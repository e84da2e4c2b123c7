"""The tool's place by the angles, and the angles by its place."""

from __future__ import annotations

import numpy as np
import pytest

from config import InputError, load_installation
from learner.tool_point import ToolPoint
from service.identification.arm_source import of_installation


@pytest.fixture(scope="module")
def tool() -> ToolPoint:
    installation = load_installation("dda")
    return ToolPoint(of_installation(installation).rigid_body(installation.joint_names, {}), "tool")


LIMITS = np.array([[0.2, 6.1], [-0.4, 5.9], [-1.4, 4.9]])


def test_angles_bring_the_tool_where_it_is_wanted(tool: ToolPoint) -> None:
    rng = np.random.default_rng(4)
    for _ in range(5):
        there = rng.uniform(LIMITS[:, 0], LIMITS[:, 1])
        point = tool.at(there)
        found = tool.angles(point, there + rng.normal(0.0, 0.1, 3), LIMITS)
        np.testing.assert_allclose(tool.at(found), point, atol=1e-6)
        assert (found >= LIMITS[:, 0]).all()
        assert (found <= LIMITS[:, 1]).all()


def test_by_hand(tool: ToolPoint) -> None:
    """Joint 3 lies 0.45 m along axis 2, the tool 0.25 m along x of link 3, all 1 m above the base."""
    np.testing.assert_allclose(tool.at(np.zeros(3)), [0.25, -0.45, 1.0], atol=1e-12)


def test_a_point_out_of_reach_is_refused(tool: ToolPoint) -> None:
    with pytest.raises(InputError, match=r"comes within .* m of it at best"):
        tool.angles(np.array([2.0, 0.0, 1.0]), np.array([3.0, 2.5, 1.5]), LIMITS)
    installation = load_installation("dda")
    with pytest.raises(InputError, match="no frame"):
        ToolPoint(of_installation(installation).rigid_body(installation.joint_names, {}), "hand")
