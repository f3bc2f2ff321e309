# SPDX-License-Identifier: Apache-2.0
"""The settings of a simulated robot (offline plant) as plain JSON values, which are stored with the transitions learned on it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, fields, is_dataclass
from typing import Any

import numpy as np

from mobee.model.world import World
from mobee.robot.robot import Robot

_WITHOUT_EFFECT = ("where", "untested", "visuals", "cameras")  # fields of a robot that change nothing that it does
_NO_MATTER = ("name", "color", "mass", "friction")  # fields of a world object; the name is its key, and no object moves on this plant
_ADDED_LATER = ("zone_ends_at_home", "least_lever")  # fields of a motor or robot that are left out if 0, so that robots keep their digests
DIGITS = 9  # decimals of lengths and angles: the same file read on another machine gives the same digest


def described(robot: Robot, world: World, **more: Any) -> dict[str, Any]:
    """Return a description of a simulated robot as plain JSON values.

    Keys: "robot" (name), "digest" (16 hex digits, a hash of the robot's properties without those that do not affect the simulation, such as
    its visuals and cameras), "world" (the present objects by name), and the keys of `more`: plain values, or dataclasses of numbers, which
    become dicts.
    """
    held = {entry.name: getattr(robot, entry.name) for entry in fields(robot) if entry.name not in _WITHOUT_EFFECT}
    content = {name: _plain(value) for name, value in held.items() if name not in _ADDED_LATER or value}
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
    objects = {
        name: {entry.name: _plain(getattr(item, entry.name)) for entry in fields(item) if entry.name not in _NO_MATTER}
        for name, item in world.objects.items()
    }
    options = {key: asdict(value) if is_dataclass(value) and not isinstance(value, type) else value for key, value in more.items()}
    found: dict[str, Any] = json.loads(json.dumps({"robot": robot.name, "digest": digest, "world": objects, **options}))
    return found


def _plain(value: Any) -> Any:
    """Return arrays, dataclasses, tuples and sets as lists, with rounded numbers."""
    if isinstance(value, np.ndarray):
        return (np.round(value, DIGITS) + 0.0).tolist()  # no -0.0
    if is_dataclass(value):
        held = {entry.name: getattr(value, entry.name) for entry in fields(value)}
        return [_plain(one) for name, one in held.items() if name not in _ADDED_LATER or one]
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, frozenset):
        return sorted(_plain(entry) for entry in value)
    return round(value, DIGITS) + 0.0 if isinstance(value, float) else value
