"""What an offline plant is, as plain values: kept with what was learned on it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, fields, is_dataclass
from typing import Any

import numpy as np

from mobee.model.world import World
from mobee.robot.robot import Robot

_UNFELT = ("where", "untested")  # of a robot: where it was read from, and why
_SHOWN = ("name", "color")  # of a world object: the name is its key
_LATER = ("zone_ends_at_home",)  # of a motor: left out where False, so that robots keep the digest they had before there was such a field
DIGITS = 9  # of lengths and angles: a file that is read on another machine is the same robot


def described(robot: Robot, world: World, **more: Any) -> dict[str, Any]:
    """The robot by name and digest, the world's objects of now, and `more`: options, and dataclasses of numbers."""
    content = {entry.name: _plain(getattr(robot, entry.name)) for entry in fields(robot) if entry.name not in _UNFELT}
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]
    objects = {
        name: {entry.name: _plain(getattr(thing, entry.name)) for entry in fields(thing) if entry.name not in _SHOWN}
        for name, thing in world.objects.items()
    }
    options = {key: asdict(value) if is_dataclass(value) and not isinstance(value, type) else value for key, value in more.items()}
    found: dict[str, Any] = json.loads(json.dumps({"robot": robot.name, "digest": digest, "world": objects, **options}))
    return found


def _plain(value: Any) -> Any:
    """Arrays, dataclasses, tuples and sets as lists, numbers rounded."""
    if isinstance(value, np.ndarray):
        return (np.round(value, DIGITS) + 0.0).tolist()  # no -0.0
    if is_dataclass(value):
        held = {entry.name: getattr(value, entry.name) for entry in fields(value)}
        return [_plain(one) for name, one in held.items() if name not in _LATER or one]
    if isinstance(value, dict):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, frozenset):
        return sorted(_plain(entry) for entry in value)
    return round(value, DIGITS) + 0.0 if isinstance(value, float) else value
