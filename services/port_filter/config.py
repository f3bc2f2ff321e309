# SPDX-License-Identifier: Apache-2.0
"""Settings of the port filter."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from msgspec import Meta

from mobee.control.reflex import ReflexSettings
from services.common.config import WorldConfig

_SETTINGS = ReflexSettings()
Seconds = Annotated[float, Meta(ge=0, le=60)]


class Config(WorldConfig, frozen=True, kw_only=True):
    """The port filter's settings; times in simulated seconds."""

    clients: Annotated[str, Meta(pattern="^[a-z0-9_]+$")] = "icub_filtered"
    """Namespace in which the clients find the robot."""
    participants: list[str] = []
    """Lockstep: clients whose answers every tick waits for."""
    contacts: Literal["solid", "field", "both"] = "both"
    """Kinds of contact that start the reflex: of bodies, or of the larger volumes around them."""
    tolerance: Annotated[float, Meta(ge=0)] = math.radians(1.0)
    """Tolerance of motor limits and clauses, rad."""
    history: Annotated[float, Meta(gt=0, le=3600)] = _SETTINGS.history
    """Time for which poses are recorded, s."""
    confirm: Seconds = _SETTINGS.confirm
    """Time for which a violation must last before it counts, s; 0: it counts at once, as in the original."""
    release: Seconds = _SETTINGS.release
    """Time without a violation after which it is over, s."""
    brake: Annotated[float, Meta(ge=0.05, le=60)] = _SETTINGS.brake
    """Time for which the robot brakes before it moves back along its path, s; the safety gate refuses to reverse a fast motion."""
    dead_time: Seconds = _SETTINGS.dead_time
    """Time for which the robot rests after it moved back, before the client gets control, s; 0: as in the original."""
    pace: Annotated[float, Meta(gt=0, le=10)] = _SETTINGS.pace
    """Number of recorded poses that the robot moves back per tick."""
    must_be_clear: bool = _SETTINGS.must_be_clear
    """Move back past a waypoint that is itself in contact; false: as in the original."""
    ttl: Annotated[int, Meta(ge=20, le=200)] = 100
    """Milliseconds without a command after which robot_sim holds a part while it moves back."""

    @property
    def reflex(self) -> ReflexSettings:
        """Return the settings of the reflex."""
        names = ("history", "confirm", "release", "brake", "dead_time", "pace", "must_be_clear")
        return ReflexSettings(**{name: getattr(self, name) for name in names})
