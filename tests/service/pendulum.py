"""Two rods with point masses at their ends, turning in a vertical plane: a URDF, and its torques by hand."""

from __future__ import annotations

import numpy as np

LENGTHS, MASSES = (0.42, 0.31), (3.1, 1.9)
URDF = f"""<robot name='stranger'><link name='base'/>
<link name='upper'><inertial><origin xyz='{LENGTHS[0]} 0 0'/><mass value='{MASSES[0]}'/>
<inertia ixx='1e-6' iyy='1e-6' izz='1e-6' ixy='0' ixz='0' iyz='0'/></inertial></link>
<link name='fore'><inertial><origin xyz='{LENGTHS[1]} 0 0'/><mass value='{MASSES[1]}'/>
<inertia ixx='1e-6' iyy='1e-6' izz='1e-6' ixy='0' ixz='0' iyz='0'/></inertial></link>
<joint name='shoulder' type='revolute'><parent link='base'/><child link='upper'/><origin rpy='1.5707963267948966 0 0'/>
<axis xyz='0 0 1'/><limit lower='-3' upper='3' velocity='5' effort='90'/></joint>
<joint name='elbow' type='revolute'><parent link='upper'/><child link='fore'/><origin xyz='{LENGTHS[0]} 0 0'/>
<axis xyz='0 0 1'/><limit lower='-3' upper='3' velocity='5' effort='90'/></joint></robot>
"""


def pendulum(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Torques of two point masses at the ends of two rods in a vertical plane, by hand."""
    (l1, l2), (m1, m2), g = LENGTHS, MASSES, 9.81
    c, s = np.cos(q[:, 1]), np.sin(q[:, 1])
    cross = m2 * l1 * l2
    far = m2 * g * l2 * np.cos(q.sum(axis=1))
    elbow = m2 * l2**2 * ddq.sum(axis=1) + cross * (c * ddq[:, 0] + s * dq[:, 0] ** 2) + far
    shoulder = (
        (m1 + m2) * l1**2 * ddq[:, 0]
        + m2 * l2**2 * ddq.sum(axis=1)
        + cross * (c * (ddq[:, 0] + ddq.sum(axis=1)) - s * (dq[:, 1] ** 2 + 2.0 * dq[:, 0] * dq[:, 1]))
        + (m1 + m2) * g * l1 * np.cos(q[:, 0])
        + far
    )
    return np.column_stack([shoulder, elbow])
