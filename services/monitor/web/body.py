# SPDX-License-Identifier: Apache-2.0
"""The robot's shapes and poses as plain JSON data, for the page's own drawing of the robot."""

from __future__ import annotations

from typing import Any

import numpy as np

from bus_schema.messages import ContactItem, WorldObject
from bus_schema.rpc import ObjectState
from mobee.arrays import Array
from mobee.model.kinematics import link_transforms, matrix_from_quaternion
from mobee.rendering import palette
from mobee.rendering.palette import Color
from mobee.robot.robot import Robot, Shape

MOST_VERTICES = 60  # of a convex shape: its outline needs no more
DIGITS = 4  # of lengths in m


def shapes_of(robot: Robot, colors: dict[str, Color]) -> list[dict[str, Any]]:
    """Return all shapes of a robot as JSON data: a dict with "link", "kind", "size", "position", "rotation", "part" and "name" for each.

    "link": index of the link. "size": [m]. "position" [m] and "rotation" (3, 3): pose of the shape in the root frame when every joint is at
    zero. "part": index of the part in `colors`; -1: none. A field, a volume that is not solid but causes a repulsive force, also has
    "field": True. A convex shape also has "vertices": (v, 3) m.
    """
    return [_shape(shape, list(colors)) for shape in robot.shapes]


def _shape(shape: Shape, parts: list[str]) -> dict[str, Any]:
    made: dict[str, Any] = {
        "link": shape.link,
        "kind": shape.kind,
        "size": list(shape.size),
        "position": _rounded(shape.position),
        "rotation": _rounded(shape.rotation),
        "part": parts.index(shape.part) if shape.part in parts else -1,
        "name": shape.name,
    }
    if shape.role == "field":
        made["field"] = True
    if shape.vertices is not None:
        made["vertices"] = _rounded(_fewer(shape.vertices))
    return made


def _fewer(vertices: Array) -> Array:
    """Return those of the vertices that are the farthest in some of many directions."""
    if len(vertices) <= MOST_VERTICES:
        return vertices
    turn, height = np.pi * (1.0 + 5.0**0.5) * np.arange(MOST_VERTICES), 1.0 - (2.0 * np.arange(MOST_VERTICES) + 1.0) / MOST_VERTICES
    ring = np.sqrt(1.0 - height**2)
    directions = np.stack([ring * np.cos(turn), ring * np.sin(turn), height], axis=1)
    kept: Array = vertices[np.unique((vertices @ directions.T).argmax(axis=0))]
    return kept


def body_at(robot: Robot, q: Array, contacts: list[ContactItem]) -> dict[str, Any]:
    """Return the robot in the pose `q` (n,) rad as JSON data.

    "links": (L, 12), for each link the rows of [R | p], root frame, m. "contacts": as returned by `contacts_of`.
    """
    transforms = link_transforms(robot, q)
    return {
        "links": np.round(transforms[:, :3, :].reshape(len(transforms), 12), DIGITS).tolist(),
        "contacts": contacts_of(contacts),
    }


def contacts_of(contacts: list[ContactItem]) -> list[dict[str, Any]]:
    """Return a list of dicts, one per contact.

    "kind": "solid" if both volumes are solid; "field" if one is a field, a larger volume that only causes a force. "first", "second": names
    of the two volumes. "point": (3,) m, root frame.
    """
    return [{"kind": c.kind, "first": c.first, "second": c.second, "point": _rounded(np.array(c.point))} for c in contacts]


def thing(item: ObjectState | WorldObject) -> dict[str, Any]:
    """Return an object of the world as JSON data: name, kind, size [m], position [m] and rotation (3 x 3; root frame), role, colour."""
    return {
        "name": item.name,
        "kind": item.geometry.kind,
        "size": list(item.geometry.size),
        "position": _rounded(np.array(item.position)),
        "rotation": _rounded(matrix_from_quaternion(np.array(item.quaternion))),
        "role": item.role,
        "color": list(palette.of_object(item.geometry.kind, item.role)[:3]),
    }


def _rounded(numbers: Array) -> list[Any]:
    found: list[Any] = np.round(numbers, DIGITS).tolist()
    return found
