# SPDX-License-Identifier: Apache-2.0
"""Chooses the marker with which a part reaches: its palm, else the end of its chain."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.contact import links_moved
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot

PALMS = ("left_palm", "right_palm")
EQUAL_DISTANCE = 1e-3  # m; palms whose distances differ by less count as equally near


def moved_markers(robot: Robot, part: str) -> tuple[str, ...]:
    """Return the names of the markers (named points on links, such as a palm) that a part moves, in the order of the robot's file.

    Raises UnknownName for a part that the robot does not have.
    """
    robot.part(part)
    moved = links_moved(robot)[part]
    return tuple(name for name, marker in robot.markers.items() if marker.link in moved)


def hand_of(robot: Robot, part: str) -> str:
    """Return the name of the marker with which a part reaches: a palm, if the part moves it.

    The palm is `left_palm` for a part whose name begins with "left", and `right_palm` for every other part, such as a torso. If the part
    does not move this palm, return the first of the `end_markers` that the part moves, or else the first marker that it moves. Raises
    UnknownName for a part that the robot does not have, InvalidValue for one that moves no marker.
    """
    found = moved_markers(robot, part)
    palm = PALMS[0] if part.startswith("left") else PALMS[1]
    if palm in found:
        return palm
    if not found:
        raise InvalidValue(f"{part} of {robot.name!r} moves no marker to reach with: {_without_markers(robot)}")
    return next((name for name in end_markers(robot) if name in found), found[0])


def end_markers(robot: Robot) -> tuple[str, ...]:
    """Return the names of the markers that a motor moves and that lie on a link without child links, such as a hand.

    A marker is a named point on a link. If there is no such marker, return all markers that a motor moves. The names are sorted by the
    number of motors that move the marker, the largest number first (a hand comes before a wheel); equal ones are in the order of the
    robot's file.
    """
    inner = {joint.parent for joint in robot.joints}
    links = frozenset[int]().union(*links_moved(robot).values())
    moved = [name for name, marker in robot.markers.items() if marker.link in links]
    ends = [name for name in moved if robot.markers[name].link not in inner] or moved
    return tuple(sorted(ends, key=lambda name: -len(_motors_before(robot, name))))


def part_of(robot: Robot, marker: str) -> str:
    """Return the part with the most motors that move a marker; among equals, the part nearest to the marker in the tree.

    Raises UnknownName for a marker that the robot does not have, InvalidValue for one that no motor moves.
    """
    owners = [robot.motor_table[motor].part for motor in _motors_before(robot, marker)]
    if not owners:
        valid = ", ".join(end_markers(robot))
        raise InvalidValue(f"no motor moves the marker {marker!r}. Valid: {valid or 'none'}.")
    return max(dict.fromkeys(owners), key=owners.count)


def hand_for(robot: Robot, place: Array | None) -> str:
    """Return the name of the marker with which to reach for a place: the candidate that is nearest to it in the robot's home posture.

    The candidates are the right and the left palm, in this order. If the robot does not have both palms, the candidates come from its
    `end_markers` (markers on links without child links), in their order: those that the largest number of motors moves. `place`:
    (3,) m, root frame; None: not known. If the place is not known, the first candidate is returned; if several candidates are equally near
    (within 1 mm), the first of these. Raises InvalidValue if no motor of the robot moves a marker.
    """
    ends = end_markers(robot)
    if not ends:
        raise InvalidValue(f"no motor of {robot.name!r} moves a marker to reach with: {_without_markers(robot)}")
    if all(palm in robot.markers for palm in PALMS):
        hands = list(reversed(PALMS))
    else:
        most = len(_motors_before(robot, ends[0]))
        hands = [name for name in ends if len(_motors_before(robot, name)) == most]
    if place is None:
        return hands[0]
    far = [float(np.linalg.norm(_at_home(robot, name) - place)) for name in hands]
    return next(name for name, distance in zip(hands, far, strict=True) if distance < min(far) + EQUAL_DISTANCE)


def require_apart(robot: Robot, part: str, marker: str, name: str, link: str) -> None:
    """Raise InvalidValue if a motor of a part moves an object together with the marker with which the part is to reach for the object.

    `name`: of the object. `link`: name of the link to which it is attached; empty: it is attached to none. Raises UnknownName for an
    unknown marker.
    """
    if not link:
        return
    together = {*_motors_before(robot, marker)} & {*_motors_of(robot, robot.links.index(link))}
    if any(robot.motor_table[motor].part == part for motor in together):
        raise InvalidValue(
            f"{name!r} is attached to the link {link!r}, which {part} moves together with the marker {marker!r}, so that a reach would not "
            "end: detach it, or reach for it with a part that does not move this link."
        )


def _motors_before(robot: Robot, marker: str) -> list[int]:
    """Return the motors that move a marker, the nearest one in the tree first."""
    return _motors_of(robot, robot.marker(marker).link)


def _motors_of(robot: Robot, link: int) -> list[int]:
    """Return the motors that move a link, the nearest one in the tree first."""
    chain: list[int] = []
    while link > 0:
        chain += np.flatnonzero(robot.coupling[0][link - 1]).tolist()
        link = robot.joints[link - 1].parent
    return list(dict.fromkeys(chain))


def _at_home(robot: Robot, name: str) -> Array:
    marker = robot.marker(name)
    link = link_transforms(robot, robot.home)[marker.link]
    place: Array = link[:3, :3] @ marker.position + link[:3, 3]
    return place


def _without_markers(robot: Robot) -> str:
    known = f"its markers are {', '.join(robot.markers)}" if robot.markers else "it has none"
    return f'{known}. Add <marker name="tip"/> at the end of its chain in zero-position XML, or a link on a fixed joint in a URDF.'
