# SPDX-License-Identifier: Apache-2.0
"""Which actions survive a hold: those that it interrupts because the model is away for a moment."""

from __future__ import annotations

import math

from bus_schema.messages import PartStatus, Tick
from services.controller.action import Action

LONGEST = 10.0  # s of the bus clock for which an action waits; a service is back within 5 s
REASON_TIME = 0.2  # s after the begin of a hold until its reason is known: robot_sim notices the end of the model before forces are old
ARM_TIME = 2.0  # s after the return of the model until the part is under control again


class Suspensions:
    """Decides whether an action continues after a hold.

    The model says what a posture touches, not where an action leads: without it the robot must rest, and afterwards a part can go on to
    the goal of its action from where it came to rest.  Any other hold ends the action, and so does a long one.
    """

    def __init__(self) -> None:
        self._lacking_at = -math.inf  # s of the bus clock at which there were last no fresh forces

    def note_forces(self, tick: Tick, fresh: bool) -> None:
        """Note at each tick whether there are fresh forces of the model."""
        if not fresh:
            self._lacking_at = tick.t * 1e-9

    def is_of_the_model(self, action: Action, tick: Tick) -> bool:
        """Return whether the hold that has suspended the action lasts, or ends now, because the model was away."""
        return self._lacking_at >= action.suspended_at and tick.t * 1e-9 - self._lacking_at <= ARM_TIME

    def may_continue(self, action: Action, tick: Tick, state: PartStatus) -> bool:
        """Return whether the action of a part that is in hold may still continue."""
        if action.target is None or not action.is_under_way or state.gate in ("estop", "fault"):
            return False
        waited = tick.t * 1e-9 - action.suspended_at if action.status == "suspended" else 0.0
        return waited <= (LONGEST if self.is_of_the_model(action, tick) else REASON_TIME)
