# SPDX-License-Identifier: Apache-2.0
"""The cameras of a robot: those of its file, or else one at each of the markers left_eye and right_eye; and those that a user adds."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.robot.robot import Camera, Robot

EYES = {"left": "left_eye", "right": "right_eye"}  # cameras, and the markers that make them
OWN = 2  # cameras of a file that make pictures unless more are named
VIEW = 50.0  # degrees, the vertical field of view of a camera whose file gives none
UPRIGHT = 1e-3  # sine of the smallest angle between a direction of view and the vertical
UP = np.array([0.0, 0.0, 1.0])  # at zero pose pictures stand upright
GRAMMAR = "NAME, NAME=x,y,z or NAME=x,y,z,dx,dy,dz: a link or a marker, a place [m] and a direction of view in its frame"


def cameras_of(robot: Robot, asked: Sequence[str] = ()) -> dict[str, Camera]:
    """Return the cameras that make pictures, by name.

    A name has only a-z, 0-9 and _, so that it is valid in a key of the bus (the message system of the services). These are the first two
    cameras of the robot's file. If the file has none, but the markers left_eye and right_eye, they are the camera "left" at left_eye and
    the camera "right" at right_eye. `asked`: further cameras: each text is the name of a camera of the file, or describes a new camera on a
    marker or link, such as "palm=0,0,0.1" (`mobee.robot.cameras.camera_on`).  Raises InvalidValue or UnknownName for a text that describes
    no camera.
    """
    own = _named(robot.cameras.values()) or _eyes(robot)
    first = dict(list(own.items())[:OWN])
    return _named([*first.values(), *(own[text] if text in own else camera_on(robot, text) for text in asked if text not in first)])


def _named(cameras: Iterable[Camera]) -> dict[str, Camera]:
    """Return cameras by the names that they have on the bus, each once."""
    found: dict[str, Camera] = {}
    for camera in cameras:
        key = name = key_of(camera.name, "camera")
        count = 2
        while key in found:
            key, count = f"{name}_{count}", count + 1
        found[key] = camera
    return found


def _eyes(robot: Robot) -> dict[str, Camera]:
    if not robot.markers.keys() >= set(EYES.values()):
        return {}
    # The eyes are inside the shapes of the head.
    head = frozenset(shape.link for shape in robot.shapes if shape.part == "head")
    found = {}
    for name, at in EYES.items():
        marker = robot.markers[at]
        found[name] = Camera(name, marker.link, marker.position, upright(marker.normal), VIEW, head)
    return found


def camera_on(robot: Robot, text: str) -> Camera:
    """Return the camera that a text describes: NAME, NAME=x,y,z or NAME=x,y,z,dx,dy,dz.

    NAME is a marker or a link; x, y, z: position [m], and dx, dy, dz: direction of view, both in the frame of the marker or link.  The
    default is the origin, with the view along a marker's normal or a link's x axis.  The frame of a link has the axes of the root frame
    at zero pose and its origin on the axis of the joint that moves the link.  A camera at the origin does not see the link that carries it.
    Raises UnknownName if there is no marker or link NAME; InvalidValue for faulty numbers or a direction of length 0.
    """
    name, equals, given = text.partition("=")
    numbers = _numbers(text, given) if equals else []
    offset, view = np.array(numbers[:3] or (0.0, 0.0, 0.0)), np.array(numbers[3:] or (0.0, 0.0, 1.0))
    if name in robot.markers:
        marker = robot.markers[name]
        link, origin, rotation = marker.link, marker.position, marker.rotation
        ahead = rotation @ view if len(numbers) == 6 else marker.normal
    elif name in robot.links:
        link = robot.links.index(name)
        origin, rotation = robot.joints[link - 1].point if link else np.zeros(3), np.eye(3)
        ahead = view if len(numbers) == 6 else np.array([1.0, 0.0, 0.0])
    else:
        raise UnknownName("link or marker", name, (*robot.links, *robot.markers))
    length = float(np.linalg.norm(ahead))
    if length < UPRIGHT:
        raise InvalidValue(f"camera {text!r}: the direction of view has no length. Write {GRAMMAR}.")
    hidden = frozenset() if offset.any() else frozenset({link})
    return Camera(name, link, origin + rotation @ offset, upright(ahead / length), VIEW, hidden)


def _numbers(text: str, given: str) -> list[float]:
    try:
        numbers = [float(word) for word in given.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 6) or not np.isfinite(numbers).all():
        raise InvalidValue(f"camera {text!r}: {given!r} is neither three nor six numbers. Write {GRAMMAR}.")
    return numbers


def key_of(name: str, otherwise: str) -> str:
    """Return a name with only the characters a-z, 0-9 and _, which are valid in keys of the bus and in file names.

    The bus is the message system of the services. Capitals become small letters, each series of other characters becomes one "_", and "_"
    at both ends is removed. `otherwise`: returned if no character remains.
    """
    return re.sub(r"[^a-z0-9_]+", "_", name.lower()).strip("_") or otherwise


def upright(ahead: Array) -> Array:
    """Return the rotation (3, 3) of a camera that looks along the unit vector `ahead` (3,) of the root frame, with an upright picture.

    The columns are the directions right and down of the picture, and `ahead`. For a vertical view, right is the -y axis of the root
    frame, as for a camera that looks along x.
    """
    right = np.cross(ahead, UP)
    if np.linalg.norm(right) <= UPRIGHT:
        right = np.array([0.0, -1.0, 0.0]) + ahead[1] * ahead  # perpendicular to a view that is not quite vertical
    right = right / np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead], axis=1)


def camera_frame(camera: Camera, transforms: Array) -> tuple[Array, Array]:
    """Return the optical centre (3,) m and the rotation (3, 3) of a camera in the root frame.

    `transforms`: (L, 4, 4), pose of each link relative to its pose at zero, as from `mobee.model.kinematics.link_transforms`.
    """
    link = transforms[camera.link]
    return link[:3, :3] @ camera.position + link[:3, 3], link[:3, :3] @ camera.rotation
