# SPDX-License-Identifier: Apache-2.0
"""Settings of the service that fetches the cup."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from mobee.arrays import Array
from mobee.behaviours.grasp import Hand
from mobee.errors import InvalidValue, UnknownName
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Robot
from services.common.config import WorldConfig

LEVEL = 0.9999  # cosine of the largest slope of the top of a box


class Config(WorldConfig, frozen=True, kw_only=True):
    """The settings of the service that fetches the cup."""

    target: str = "cup"
    """Name of the upright thing to fetch, as vision names it."""
    marker: str = "right_palm"
    """Marker of the palm that fetches the thing."""
    gains: Literal["default"] = "default"
    """Name of the controller's set of gains."""
    times: Annotated[int, Meta(ge=1)] = 1
    """How many times the service puts the thing down elsewhere before it ends."""
    fresh: Annotated[float, Meta(ge=0.1, le=5)] = 1.0
    """Time without a new position of the thing after which the service pauses, s of simulated time. It does not pause while the hand hides
    the thing."""

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if these settings do not fit the robot and the world.

        They do not fit if the robot has no such `marker`, or no fingers at it; if the world has no such `target`, or no level box below it;
        or if a part's name cannot be used on the bus.
        """
        super().check_robot(robot)
        Hand(robot, self.marker)
        self.ground()

    def ground(self) -> float:
        """Return the height [m], root frame, of the surface on which the thing to fetch (`target`) stands in the world's file.

        Raises UnknownName if the world has no such thing, InvalidValue if no level box is below it.
        """
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
