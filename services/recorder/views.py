# SPDX-License-Identifier: Apache-2.0
"""Makes copies of messages for viewers: in JSON, and the robot's pose as ROS 2 messages (motors as JointState, links as transforms).

The rate of the copies is limited, except for single events, such as emergency stops. Pictures and learned data have no copies in JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache

import msgspec
import numpy as np

from bus_schema import UNDECODABLE
from bus_schema.messages import Tick
from bus_schema.schemas import schemas_of
from mobee import Model
from mobee.model.kinematics import quaternion_from_matrix
from mobee.robot.robot import Robot
from services.common.tap import Raw
from services.recorder import ros
from services.recorder.files import Channel

Copy = tuple[Channel, bytes]
_NEVER = ("Learned", "Image")  # of bytes that JSON cannot show
_ALWAYS = ("Event", "EStop", "Transition", "Decision", "Served")  # single events; the other streams repeat
_JOINTS = Channel("/joint_states", "cdr", "", ros.JOINT_STATE, "ros2msg", ros.JOINT_STATE_DEFINITION.encode())
_TRANSFORMS = Channel("/tf", "cdr", "", ros.TRANSFORMS, "ros2msg", ros.TRANSFORMS_DEFINITION.encode())
_decode = msgspec.msgpack.Decoder().decode
_tick = msgspec.msgpack.Decoder(Tick)


class Views:
    """Makes copies of recorded messages, in JSON or as ROS 2 messages, which viewers can show."""

    def __init__(self, robot: Robot, pose_rate: float, json_rate: float) -> None:
        """Prepare to make copies of the messages of this robot.

        `pose_rate`: largest number of copies of the robot's pose per second of real time; 0: none. `json_rate`: largest number of JSON
        copies of each key per second; 0: only single events, such as emergency stops, which are always copied.
        """
        self._robot = robot
        self._model = Model(robot)
        self._joints, self._transforms = ros.JointStates(robot.motors), ros.Transforms(robot.links)
        self._pose_due, self._json_due = _Due(pose_rate), _Due(json_rate)

    def of(self, message: Raw, kind: str) -> Iterator[Copy]:
        """Yield the copies of a recorded message, each with the channel to which it is written.

        `kind`: name of the message's type. A message that cannot be decoded has no copies.
        """
        try:
            if kind == "Tick" and self._pose_due.at(message):
                yield from self._of_tick(_tick.decode(message.payload))
            if kind in _ALWAYS or (kind not in _NEVER and self._json_due.at(message)):
                content = _decode(message.payload)
                if kind == "Served":
                    content["request"], content["reply"] = _decode(content["request"]), _decode(content["reply"])
                yield _json_channel(message.key, kind), msgspec.json.encode(content)
        except (*UNDECODABLE, TypeError, KeyError):
            return  # a message that services refuse too; it is recorded as it is

    def _of_tick(self, tick: Tick) -> Iterator[Copy]:
        q = np.array(tick.q)
        if len(q) != len(self._robot.motors) or not np.isfinite(q).all() or tick.t >= ros.END_OF_TIME:
            return
        yield _JOINTS, self._joints.encode(tick.t, q)
        poses = self._model.evaluate(q).transforms
        yield _TRANSFORMS, self._transforms.encode(tick.t, poses[:, :3, 3], quaternion_from_matrix(poses[:, :3, :3]))


class _Due:
    """Decides for each key whether a copy is due at a rate."""

    def __init__(self, rate: float) -> None:
        self._period = round(1e9 / rate) if rate else 0
        self._next: dict[str, int] = {}  # ns since 1970

    def at(self, message: Raw) -> bool:
        """Return whether this message is to be copied: the period of the rate has passed since the last copied message of its key.

        Always False if the rate is 0.
        """
        if not self._period or message.received < self._next.get(message.key, 0):
            return False
        self._next[message.key] = message.received + self._period
        return True


@cache
def _json_channel(key: str, kind: str) -> Channel:
    """Return the channel of the JSON copies of a key; a key of calls has no schema, since its messages have several types."""
    schema = {} if kind == "Served" else schemas_of(kind)
    definition = json.dumps(schema["message"]).encode() if schema else b""
    return Channel(f"json/{key}", "json", "", kind if schema else "", "jsonschema" if schema else "", definition)
