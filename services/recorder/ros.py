# SPDX-License-Identifier: Apache-2.0
"""Encodes motor states and link poses as ROS 2 messages that common viewers show: `sensor_msgs/JointState` and `tf2_msgs/TFMessage` in CDR.

The names in these messages never change. Therefore the bytes are laid out once, and only times and numbers are written for each message.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numpy as np

from mobee.arrays import Array

_LINE = "=" * 80
_TIME = f"{_LINE}\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_HEADER = f"{_LINE}\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n{_TIME}"
JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_STATE_DEFINITION = f"std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{_HEADER}"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
TRANSFORMS_DEFINITION = f"""geometry_msgs/TransformStamped[] transforms
{_LINE}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{_LINE}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{_LINE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{_LINE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{_HEADER}"""
ROOT_FRAME = "root_frame"
END_OF_TIME = 2**31 * 1_000_000_000  # ns; the seconds of a stamp are an int32


class _Layout:
    """A CDR message (little-endian) under construction; numbers are filled in later."""

    def __init__(self) -> None:
        self.data = bytearray(b"\x00\x01\x00\x00")

    def reserve(self, size: int, count: int) -> int:
        """Make room for `count` numbers of `size` bytes; return where they begin."""
        self.data += bytes(-(len(self.data) - 4) % size)
        begin = len(self.data)
        self.data += bytes(size * count)
        return begin

    def count(self, number: int) -> None:
        """Append the length of a sequence."""
        struct.pack_into("<I", self.data, self.reserve(4, 1), number)

    def text(self, text: str) -> None:
        """Append a string."""
        content = text.encode() + b"\x00"
        self.count(len(content))
        self.data += content

    def stamp(self) -> int:
        """Make room for a time; return where it begins."""
        return self.reserve(4, 2)


class JointStates:
    """Encodes the positions of all motors as `sensor_msgs/JointState`. `motors`: names, in the order of the positions."""

    def __init__(self, motors: Sequence[str]) -> None:
        layout = _Layout()
        self._stamp = layout.stamp()
        layout.text("")
        layout.count(len(motors))
        for name in motors:
            layout.text(name)
        layout.count(len(motors))
        self._positions = layout.reserve(8, len(motors))
        layout.count(0)  # velocities and efforts are not measured at the same time
        layout.count(0)
        self._data = layout.data

    def encode(self, t: int, q: Array) -> bytes:
        """Return the encoded message. `t`: the robot's time [ns], below END_OF_TIME (2^31 s). `q`: motor positions (n,) rad."""
        struct.pack_into("<iI", self._data, self._stamp, *divmod(t, 1_000_000_000))
        self._data[self._positions : self._positions + 8 * len(q)] = q.astype("<f8").tobytes()
        return bytes(self._data)


class Transforms:
    """Encodes the pose of every link in the root frame as `tf2_msgs/TFMessage`. `links`: names, in the order of the poses."""

    def __init__(self, links: Sequence[str]) -> None:
        layout = _Layout()
        layout.count(len(links))
        stamps, poses = [], []
        for name in links:
            stamps.append(layout.stamp())
            layout.text(ROOT_FRAME)
            layout.text(name)
            poses.append(layout.reserve(8, 7))
        self._stamps = np.array(stamps)[:, None] + np.arange(8)  # places of the bytes
        self._poses = np.array(poses)[:, None] + np.arange(56)
        self._data = np.frombuffer(layout.data, dtype=np.uint8)

    def encode(self, t: int, positions: Array, quaternions: Array) -> bytes:
        """Return the encoded message.

        `t`: the robot's time [ns], below END_OF_TIME (2^31 s). `positions`: (L, 3) m, root frame. `quaternions`: (L, 4), order wxyz.
        """
        rows = np.column_stack([positions, quaternions[:, [1, 2, 3, 0]]]).astype("<f8")
        self._data[self._stamps] = np.frombuffer(struct.pack("<iI", *divmod(t, 1_000_000_000)), dtype=np.uint8)
        self._data[self._poses] = rows.view(np.uint8)
        return self._data.tobytes()
