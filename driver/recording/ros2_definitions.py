"""Definitions of the ROS 2 message types in a recording, as an MCAP schema carries them (encoding ``ros2msg``).

Types that a definition uses follow it, each behind a line of equals signs and its name, so that readers without
ROS can decode. Taken from common_interfaces, rcl_interfaces and ros_canopen.
"""

from __future__ import annotations

_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_VECTOR3 = "float64 x\nfloat64 y\nfloat64 z\n"
_STAMPED = {"std_msgs/Header": _HEADER, "builtin_interfaces/Time": _TIME}


def _definition(fields: str, uses: dict[str, str]) -> str:
    return fields + "".join(f"{'=' * 80}\nMSG: {name}\n{text}" for name, text in uses.items())


JOINT_STATE = "sensor_msgs/msg/JointState"
WRENCH_STAMPED = "geometry_msgs/msg/WrenchStamped"
TEMPERATURE = "sensor_msgs/msg/Temperature"
CAN_FRAME = "can_msgs/msg/Frame"
BYTES = "std_msgs/msg/UInt8MultiArray"
LOG = "rcl_interfaces/msg/Log"

DEFINITIONS: dict[str, str] = {
    JOINT_STATE: _definition(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n", _STAMPED
    ),
    WRENCH_STAMPED: _definition(
        "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
        {
            **_STAMPED,
            "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
            "geometry_msgs/Vector3": _VECTOR3,
        },
    ),
    TEMPERATURE: _definition("std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n", _STAMPED),
    CAN_FRAME: _definition(
        "std_msgs/Header header\nuint32 id\nbool is_rtr\nbool is_extended\nbool is_error\nuint8 dlc\nuint8[8] data\n",
        _STAMPED,
    ),
    BYTES: _definition(
        "std_msgs/MultiArrayLayout layout\nuint8[] data\n",
        {
            "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
            "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
        },
    ),
    LOG: _definition(
        "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n"
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\n"
        "string file\nstring function\nuint32 line\n",
        {"builtin_interfaces/Time": _TIME},
    ),
}
"""By type name."""
