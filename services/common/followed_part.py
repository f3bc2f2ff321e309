# SPDX-License-Identifier: Apache-2.0
"""The part that a behaviour moves: requests the part's goal from the controller, and moves the part's attractor.

The goal of a part is the right to set its attractor, the posture to which the controller moves the part. No method waits for an answer.
"""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from bus_schema import keys
from bus_schema.authority import BEHAVIOURS
from bus_schema.messages import Follow, Motion
from bus_schema.rpc import Done, Take, Taken, WithEpoch
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.rpc import CallFailed
from services.common.service import Service

RETRY_PERIOD = 0.5  # s of real time between two attempts to take the part


class FollowedPart:
    """Requests and releases the goal of one part for a behaviour, moves the part, and keeps the newest `Motion` message of every part.

    A `Motion` message is the controller's report about a part: positions, commanded velocity, attractor, and the owner of the goal.
    The goal of a part is the right to set its attractor (the posture to which the controller moves the part). The controller gives this
    right to one service at a time. No method waits for an answer.
    """

    def __init__(self, service: Service, robot: Robot, part: str) -> None:
        self._service, self._robot, self._part = service, robot, part
        self._low, self._high = robot.limits[robot.part(part).slice].T
        self._stream = service.bus.publisher(Follow, part)
        self._motions: dict[str, Motion] = {}
        self._epoch = 0  # of this service's ownership, 0: none
        self._next_try = 0.0  # monotonic clock
        for name in robot.parts:
            service.on_newest(Motion, partial(self._note_motion, name), name)
        service.on_alive(self._note_alive)

    @property
    def is_owned(self) -> bool:
        """Whether the goal of the part belongs to this service."""
        motion = self._motions.get(self._part)
        return self._epoch > 0 and motion is not None and motion.epoch == self._epoch

    def why_not(self) -> str:
        """Return the reason why the part cannot be moved now, as a text; empty if the part can be moved."""
        motion = self._motions.get(self._part)
        if motion is None:
            return f"no message about {self._part}"
        if motion.status in ("held", "suspended"):
            return f"{self._part} is in hold"
        if self.is_owned:
            return ""
        return f"the goal of {self._part} belongs to {motion.owner}" if motion.owner else f"the goal of {self._part} is not taken yet"

    def velocities(self) -> Array:
        """Return the commanded velocities of all motors, (n,) rad/s, as the controller reports them; 0 for parts without a report."""
        found = np.zeros(len(self._robot.motors))
        for name, motion in self._motions.items():
            found[self._robot.part(name).slice] = motion.dq
        return found

    def take(self) -> None:
        """Ask the controller for the goal of the part (the right to set its attractor), at most once per RETRY_PERIOD (0.5 s).

        `is_owned` becomes True when this service has got the goal. If the goal belongs to a service that is not a behaviour (`assist` or
        `gaze`), no call is made. If it belongs to the other behaviour, the controller gives it to this service only if this service has
        the higher rank (services/controller/precedence.py).
        """
        now, motion = time.monotonic(), self._motions.get(self._part)
        if motion is None or motion.owner not in ("", self._service.who, *BEHAVIOURS):
            return
        if self.is_owned or now < self._next_try or not self._service.alive.get("controller"):
            return
        self._next_try = now + RETRY_PERIOD
        self._service.ask(keys.goal(self._part, "take"), Taken, self._taken, request=Take, instance=self._service.instance)

    def release(self) -> None:
        """Release the goal of the part. The part brakes, and moves to the posture in the controller's settings if there is one."""
        epoch, self._epoch = self._epoch, 0
        self._service.ask(keys.goal(self._part, "release"), Done, self._released, request=WithEpoch, epoch=epoch)

    def move(self, q: Array, velocity: Array) -> None:
        """Set the attractor (posture to which the controller moves the part) to q (n_part,) rad, moving with `velocity` (n_part,) rad/s.

        q is clipped to the motors' limits.
        """
        self._stream.put(epoch=self._epoch, q=np.clip(q, self._low, self._high).tolist(), dq=velocity.tolist())

    def forget(self) -> None:
        """Drop the stored `Motion` messages (the controller's reports about the parts); call this at the start of a run."""
        self._motions.clear()

    def _note_motion(self, part: str, motion: Motion) -> None:
        self._motions[part] = motion

    def _taken(self, answer: Taken | CallFailed) -> None:
        if isinstance(answer, Taken):
            self._epoch = answer.epoch

    def _released(self, answer: Done | CallFailed) -> None:
        if isinstance(answer, CallFailed):
            self._service.log.info("%s could not be released: %s", self._part, answer)

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if who == "controller":
            self._epoch, self._next_try = 0, 0.0
