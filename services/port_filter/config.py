# SPDX-License-Identifier: Apache-2.0
"""Settings of the port filter, the process that moves the robot back if a client moves it into contact."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta

from mobee.control.reflex import ReflexSettings
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot
from services.common.config import WorldConfig

_SETTINGS = ReflexSettings()
Seconds = Annotated[float, Meta(ge=0, le=60)]


class Config(WorldConfig, frozen=True, kw_only=True):
    """The settings of the port filter, a process between its clients and the robot (thesis chapter 4).

    Its reflex takes control when a motion leads into contact, and moves the robot back along its past poses. Times are in seconds of
    simulated time.
    """

    clients: Annotated[str, Meta(pattern="^[a-z0-9_]+$")] = "icub_filtered"
    """Namespace (first part of all keys) in which the filter's clients find the robot."""
    participants: list[Annotated[str, Meta(pattern="^[a-z0-9_]+$")]] = []
    """In lockstep: names of the clients whose answers every tick waits for."""
    contacts: Literal["solid", "field", "both"] = "both"
    """Kinds of contact that start the reflex. solid: contacts of solid shapes; field: contacts of the larger volumes around them; both:
    either kind."""
    tolerance: Annotated[float, Meta(ge=0)] = math.radians(1.0)
    """Distance [rad; m for motors that slide] by which a pose may be beyond a motor limit or a clause (a condition on several motors)
    before this counts as a violation."""
    history: Annotated[float, Meta(gt=0, le=3600)] = _SETTINGS.history
    """Length of the record of past poses [s], along which the reflex can move the robot back."""
    confirm: Seconds = _SETTINGS.confirm
    """Time for which a violation must last before it starts the reflex [s]; 0: at once, as in thesis 4.1."""
    release: Seconds = _SETTINGS.release
    """Time without a violation after which a violation counts as ended [s]."""
    brake: Annotated[float, Meta(ge=0.05, le=60)] = _SETTINGS.brake
    """Time for which the robot brakes before it moves back along its path [s]. It is needed because the safety gate refuses to reverse a
    fast motion."""
    dead_time: Seconds = _SETTINGS.dead_time
    """Time for which the robot rests after it has moved back, before the client gets control again [s]; 0: none, as in thesis 4.1."""
    pace: Annotated[float, Meta(gt=0, le=10)] = _SETTINGS.pace
    """Speed at which the robot moves back, in recorded poses per tick; 1: as fast as the recorded motion."""
    must_be_clear: bool = _SETTINGS.must_be_clear
    """Whether to continue to move back if the pose at a waypoint is itself in violation (contact, limit or clause). False: stop at the
    waypoint, as in thesis 4.1."""
    ttl: Annotated[int, Meta(ge=20, le=200)] = 100
    """Lifetime of the reflex's commands [ms]: robot_sim holds a part if no new command arrives within this time."""

    def check_robot(self, robot: Robot) -> None:
        """Raise InvalidValue if the clients would find the filter where the robot itself is, or if a part's name cannot be used."""
        super().check_robot(robot)
        if self.clients == self.namespace:
            raise InvalidValue(
                f'clients = "{self.clients}" is the namespace of the robot itself: give another one, such as "{self.namespace}_filtered".'
            )

    @property
    def reflex(self) -> ReflexSettings:
        """The settings of the reflex (which moves the robot back from a violation along its past poses), taken from these settings."""
        names = ("history", "confirm", "release", "brake", "dead_time", "pace", "must_be_clear")
        return ReflexSettings(**{name: getattr(self, name) for name in names})
