# SPDX-License-Identifier: Apache-2.0
"""Settings of the service that fetches the cup."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from mobee.arrays import Array
from mobee.behaviours.hand import Hand
from mobee.errors import InvalidValue, UnknownName
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Robot
from services.common.config import WorldConfig

LEVEL = 0.9999  # cosine of the largest slope of the top of a box


class Config(WorldConfig, frozen=True, kw_only=True):
    """The settings."""

    target: str = "cup"
    """The upright thing that it fetches, as vision names it."""
    marker: str = "right_palm"
    """The palm that fetches."""
    gains: Literal["default"] = "default"
    """Name of the controller's set of gains."""
    times: Annotated[int, Meta(ge=1)] = 1
    """How often it puts the thing elsewhere, before it ends."""
    fresh: Annotated[float, Meta(ge=0.1, le=5)] = 1.0
    """Time without a new place of the thing after which it pauses, s of simulated time; not while the hand hides it."""

    def check_robot(self, robot: Robot) -> None:
        """Check also that the robot has the hand, and that the thing stands on something; raises MobeeError."""
        super().check_robot(robot)
        Hand(robot, self.marker)
        self.ground()

    def ground(self) -> float:
        """Return the height [m] of what the thing stands on in the world's file; raises UnknownName and InvalidValue."""
        objects = self.load_world().objects
        if self.target not in objects:
            raise UnknownName("target", self.target, [name for name, item in objects.items() if item.role == "target"])
        place = objects[self.target].position
        below = [item for item in objects.values() if item.role == "obstacle" and _is_below(item, place)]
        if not below:
            at = ", ".join(f"{number:g}" for number in place)
            raise InvalidValue(
                f"{self.target} stands on nothing: the world {self.world!r} has no level box below ({at}) m. "
                f'Add one to its file, as <box name="table" .../>, or move {self.target} above one.'
            )
        return max(float(item.position[2] + 0.5 * item.size[2]) for item in below)


def _is_below(item: WorldObject, place: Array) -> bool:
    """Return whether an object is a level box below a place (3,) m."""
    if item.kind != "box" or item.rotation[2, 2] < LEVEL:
        return False
    local = (place - item.position) @ item.rotation
    return bool((abs(local[:2]) <= 0.5 * np.array(item.size[:2])).all() and local[2] > 0.5 * item.size[2])
