# SPDX-License-Identifier: Apache-2.0
"""Where the hand of a part is in each state of an agent's space."""

from __future__ import annotations

import json

import numpy as np

from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.learning.record import space_from
from mobee.learning.space import Space
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot
from services.common.hands import moved_markers

MAX_STATES = 4096  # more places could not be told apart


def space_of(settings: str, robot: Robot) -> Space | None:
    """Return the space of a `Learned` message; None if this robot cannot make it."""
    try:
        return space_from(json.loads(settings), robot)
    except (MobeeError, ValueError, TypeError):  # of another robot or version: its numbers cannot be placed
        return None


def shown_marker(robot: Robot, part: str) -> str | None:
    """Return the marker that shows where a part is: the one with the fewest motors of other parts before it, then the farthest.

    That is an arm's palm, and a torso's head; None if the part moves no marker.
    """

    def rank(name: str) -> tuple[int, int]:
        parts = [robot.motor_table[motor].part for motor in _motors_before(robot, name)]
        return sum(other != part for other in parts), -len(parts)

    return min(moved_markers(robot, part), key=rank, default=None)


def base_link(robot: Robot, part: str) -> int:
    """Return the link that a part is mounted on."""
    first = {index for motor in robot.motor_table if motor.part == part for index, _, _ in motor.joints}
    return min((robot.joints[index].parent for index in first), default=0)


def places(space: Space, marker: str, q: Array) -> Array:
    """Return the marker's place in each state, (S, 3) m in the frame of the link that the part is mounted on.

    `q`: (n,) rad, posture of the other parts.
    """
    robot, part = space.robot, space.robot.part(space.part)
    base, found = base_link(robot, space.part), robot.marker(marker)
    poses = np.tile(q, (len(space), 1))
    for state in range(len(space)):
        poses[state, part.slice] = space.target(state)
    where = np.empty((len(space), 3))
    for state, pose in enumerate(poses):
        transforms = link_transforms(robot, pose)
        seen = transforms[found.link, :3, :3] @ found.position + transforms[found.link, :3, 3]
        where[state] = transforms[base, :3, :3].T @ (seen - transforms[base, :3, 3])
    return where


def _motors_before(robot: Robot, marker: str) -> list[int]:
    link, chain = robot.marker(marker).link, list[int]()
    while link > 0:
        chain += np.flatnonzero(robot.coupling[0][link - 1]).tolist()
        link = robot.joints[link - 1].parent
    return list(dict.fromkeys(chain))
