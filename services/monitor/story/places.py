# SPDX-License-Identifier: Apache-2.0
"""Computes the position of a part's hand in each state of an agent's state space."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.learning.record import space_from
from mobee.learning.space import Space
from mobee.model.contact import links_moved
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot
from services.common.hands import moved_markers

MAX_STATES = 4096  # more places could not be distinguished


def space_of(settings: str, robot: Robot) -> Space | None:
    """Rebuild an agent's state space from `settings`, the JSON text in its `Learned` messages; None if it is not valid for this robot."""
    try:
        return space_from(json.loads(settings), robot)
    except (MobeeError, ValueError, TypeError, RecursionError):  # of another robot or version: its numbers cannot be placed
        return None


@dataclass(frozen=True, eq=False)
class Spot:
    """A point on a link that represents a part in pictures and texts, such as the palm for an arm.

    `name`: name of the marker (named point of a link) at the point; if there is no marker, "end of the" and the name of the part. `link`:
    index of the link. `position`: (3,) m, in the root frame with every joint at zero.
    """

    name: str
    link: int
    position: Array


def shown_spot(robot: Robot, part: str) -> Spot | None:
    """Return the point that represents a part in pictures and texts, such as the palm for an arm; None if no link moves with the part.

    It is a marker (named point of a link) that the part moves. The marker is chosen whose position depends on the fewest motors of other
    parts; if several markers depend on equally few, the one of these that depends on the most motors. If the part moves no marker, a
    point of a link is used, which is chosen by the same rule.
    """

    def rank(link: int) -> tuple[int, int]:
        parts = [robot.motor_table[motor].part for motor in _motors_before(robot, link)]
        return sum(other != part for other in parts), -len(parts)

    marker = min((robot.marker(name) for name in moved_markers(robot, part)), key=lambda one: rank(one.link), default=None)
    if marker is not None:
        return Spot(marker.name, marker.link, marker.position)
    link = min(links_moved(robot)[part], key=rank, default=0)
    if link == 0:
        return None
    solids = [shape.position for shape in robot.shapes if shape.link == link]
    return Spot(f"end of the {part}", link, np.mean(solids, axis=0) if solids else robot.joints[link - 1].point)


def base_link(robot: Robot, part: str) -> int:
    """Return the index of the link on which a part is mounted: the parent of its first joint, 0 (root) if it has none."""
    first = {index for motor in robot.motor_table if motor.part == part for index, _, _ in motor.joints}
    return min((robot.joints[index].parent for index in first), default=0)


def places(space: Space, spot: Spot, q: Array) -> Array:
    """Return the position of `spot` in each of the S states of a part's state space, (S, 3) m.

    The positions are in the frame of the link on which the part is mounted. This frame equals the root frame when all joints are at zero,
    and moves with the link.

    `space`: the state space, which names its part. `q`: posture of the whole robot, (n,) rad; the part's own motors are replaced by the
    motor positions of each state.
    """
    robot, part = space.robot, space.robot.part(space.part)
    base, pose = base_link(robot, space.part), q.copy()
    where = np.empty((len(space), 3))
    for state in range(len(space)):
        pose[part.slice] = space.target(state)
        transforms = link_transforms(robot, pose)
        seen = transforms[spot.link, :3, :3] @ spot.position + transforms[spot.link, :3, 3]
        where[state] = transforms[base, :3, :3].T @ (seen - transforms[base, :3, 3])
    return where


def _motors_before(robot: Robot, link: int) -> list[int]:
    chain: list[int] = []
    while link > 0:
        chain += np.flatnonzero(robot.coupling[0][link - 1]).tolist()
        link = robot.joints[link - 1].parent
    return list(dict.fromkeys(chain))
