# SPDX-License-Identifier: Apache-2.0
"""The default world of a robot, the objects of a world in the form of messages, and a hash by which processes compare their robots."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from bus_schema.messages import Geometry
from bus_schema.rpc import ObjectState
from mobee.errors import InvalidValue
from mobee.model.kinematics import quaternion_from_matrix
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Robot

NO_WORLD = "none"  # setting for a world without objects
TABLE = "table"
AT_TABLE = ("icub", "icub_2014", "icub_katana")  # shipped robots whose experiments take place at the table


def effective_world(given: str | None, robot: str | Path) -> str:
    """Return the name or path of the world to load, or NO_WORLD ("none").

    Args:
        given: a shipped world, a path, or NO_WORLD. Empty or None: the default of the robot. This is the shipped world `table` for the
            shipped iCubs (the names in AT_TABLE), and NO_WORLD for every other robot.
        robot: the shipped name or the path from which the robot is loaded. For a path the default is NO_WORLD, even if the file has the
            name icub.
    """
    if given:
        return given
    return TABLE if str(robot) in AT_TABLE else NO_WORLD


def is_path(name_or_path: object) -> bool:
    """Return whether load_robot and load_world read `name_or_path` as the path of a file, not as a shipped name."""
    return isinstance(name_or_path, str) and (bool(Path(name_or_path).suffix) or Path(name_or_path).name != name_or_path)


def world_around(given: str | None, robot: str | Path) -> World:
    """Return a new world for a robot, loaded by the name or path that `effective_world` chooses; empty if that is "none".

    `given`: a shipped world, a path, "none", or empty for the default of the robot. `robot`: shipped name or path of the robot. Raises
    MobeeError for a name or file that cannot be read.
    """
    name = effective_world(given, robot)
    return World() if name == NO_WORLD else load_world(name)


def require_sizes(shape: Geometry) -> None:
    """Raise InvalidValue if a shape from a message has a wrong number of sizes: sphere 1, capsule and cylinder 2, box 3."""
    expected = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}[shape.kind]
    if len(shape.size) != expected:
        raise InvalidValue(f"{shape.kind} of size {shape.size}: must be {expected} lengths in metres")


def object_state(thing: WorldObject, link: str = "") -> ObjectState:
    """Return a world object in the form in which the model lists it on the bus.

    `link`: name of the link to which the object is attached; empty: none. Raises InvalidValue for a convex volume, for which the bus has no
    message.
    """
    if thing.kind == "convex":  # of links only: World.add takes none
        raise InvalidValue(f"{thing.name!r} is a convex volume, for which the bus has no message")
    return ObjectState(
        name=thing.name,
        geometry=Geometry(kind=thing.kind, size=list(thing.size)),
        position=thing.position.tolist(),
        quaternion=quaternion_from_matrix(thing.rotation).tolist(),
        role=thing.role,
        link=link,
    )


def robot_hash(robot: Robot) -> str:
    """Return a hash of the robot's names, tree and motors, 16 characters, by which processes compare their robots.

    Shapes are not included, because commands do not depend on them.
    """
    digest = hashlib.sha256(repr((robot.name, robot.links, robot.motors)).encode())
    for joint in robot.joints:
        digest.update(repr((joint.name, joint.parent, joint.kind)).encode())
        digest.update(np.concatenate([joint.axis, joint.point, joint.limits]).tobytes())
    digest.update(np.array([(*m.limits, m.max_velocity, m.max_acceleration, m.max_torque) for m in robot.motor_table]).tobytes())
    return digest.hexdigest()[:16]
