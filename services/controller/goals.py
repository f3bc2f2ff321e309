# SPDX-License-Identifier: Apache-2.0
"""Answers the calls of agents: take, release and set a part's goal, apply a force, reach.

It also moves attractors (the postures to which the controller moves the parts) by `Follow` messages.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np

from bus_schema import VERSION, keys
from bus_schema.messages import Follow
from bus_schema.rpc import Done, Force, Goal, ReachFor, Reply, Request, Started, Take, Taken, WithEpoch
from mobee.arrays import Array
from mobee.control.forces import LARGEST_FORCE
from mobee.errors import InvalidValue, MobeeError
from mobee.model.contact import links_moved
from mobee.robot.motor_units import unit_name
from mobee.robot.robot import Robot
from services.common.service import CallRefused, Service
from services.controller.action import Action, Owner
from services.controller.law import RobotLaw
from services.controller.precedence import may_take_from
from services.controller.publish import CommandPublisher
from services.controller.reaches import Reaches

DONE = Done(v=VERSION)


_Q = TypeVar("_Q", bound=Request)


def _by_part(handler: Callable[[str, _Q], Reply]) -> Callable[[_Q, str], Reply]:
    return lambda request, key: handler(key.split("/")[0], request)


class GoalServer:
    """Answers calls about the goals of all parts: take, release, goal, force and reach.

    The goal of a part is the right to set its attractor, the posture to which the controller moves it. Each new owner of a goal gets a new
    epoch, a number that its later calls must contain. The ownership ends when the owner's liveliness token disappears.
    """

    def __init__(
        self, service: Service, robot: Robot, law: RobotLaw, actions: dict[str, Action], reaches: Reaches, commands: CommandPublisher
    ) -> None:
        self._service, self._robot, self._law, self._actions = service, robot, law, actions
        self._reaches, self._commands = reaches, commands
        self._epoch = time.time_ns() // 1_000_000  # newer than any epoch of an earlier controller
        self.paused_at: int | None = None
        """Tick at which the robot was paused, until the first step after the pause; None: it is not paused."""
        service.on_request(keys.goal("*", "take"), Take, _by_part(self._take), part_of_key=True)
        service.on_request(keys.goal("*", "release"), WithEpoch, _by_part(self._release), part_of_key=True)
        service.on_request(keys.goal("*", "goal"), Goal, _by_part(self._goal), part_of_key=True)
        service.on_request(keys.goal("*", "force"), Force, _by_part(self._force), part_of_key=True)
        service.on_request(keys.goal("*", "reach"), ReachFor, _by_part(self._reach), part_of_key=True)
        for part in robot.parts:
            service.on_newest(Follow, partial(self._follow, part), part)
        service.on_alive(self._note_alive)

    def _take(self, part: str, request: Take) -> Taken:
        owner = self._actions[part].owner
        is_owned = owner is not None and owner.instance != request.instance and owner.instance in self._service.alive.get(owner.who, ())
        if owner is not None and is_owned and not may_take_from(request.who, owner.who):
            raise CallRefused("owned", f"the goal of {part} belongs to {owner.who}, which must release it first")
        if request.instance not in self._service.alive.get(request.who, ()):
            raise CallRefused("token", f"no liveliness token alive/{request.who}/{request.instance}: declare it before taking a goal")
        if owner is not None and is_owned:
            self._service.bus.event("info", "taken", f"{request.who} takes the goal of {part} from {owner.who}")
            self._end_ownership(part)
        self._epoch += 1
        self._actions[part].owner = Owner(request.who, request.instance, self._epoch)
        return Taken(v=VERSION, epoch=self._epoch)

    def _release(self, part: str, request: WithEpoch) -> Done:
        self._check_epoch(part, request.epoch)
        self._end_ownership(part)
        return DONE

    def _goal(self, part: str, request: Goal) -> Started:
        self._check_epoch(part, request.epoch)
        target = np.array(request.q)
        self._check_limits(part, target)
        self._check_free(part)
        self._reaches.interrupt(part)
        self._law.set_attractor(part, target)
        return self._start(part, request.action_id, target)

    def _reach(self, part: str, request: ReachFor) -> Started:
        self._check_epoch(part, request.epoch)
        self._check_free(part)
        self._check_running()
        try:
            self._reaches.begin(part, request)
        except MobeeError as error:
            raise CallRefused("reach", str(error)) from None
        started = self._start(part, request.action_id)
        self._commands.send_again(part)  # before the next tick
        return started

    def _follow(self, part: str, follow: Follow) -> None:
        """Move the attractor of a part (the position that attracts its motors) as the message `follow` of its owner requests.

        The part's present action ends. A message of an earlier owner has no effect.
        """
        action, motors = self._actions[part], self._robot.motor_table[self._robot.part(part).slice]
        if action.owner is None or action.owner.epoch != follow.epoch or action.is_in_hold:
            return
        target, fastest = np.array(follow.q), np.array([motor.max_velocity for motor in motors])
        if outside := self._beyond_limits(part, target):
            self._service.bus.reject("limits", f"attractor that moves: {outside}")
            return
        if action.is_under_way:
            self._reaches.interrupt(part)
            action.resume(self._service.bus.k)
        self._law.follow(part, target, np.clip(follow.dq, -fastest, fastest))

    def _start(self, part: str, action_id: str, target: Array | None = None) -> Started:
        self._actions[part].start(action_id, self._service.bus.k, self._service.bus.t * 1e-9, target)
        return Started(v=VERSION, k=self._service.bus.k)

    def _force(self, part: str, request: Force) -> Done:
        self._check_epoch(part, request.epoch)
        if request.f is not None or request.marker is not None:
            if self._actions[part].is_in_hold:
                raise CallRefused("held", f"{part} is in hold, and takes no force: wait until the status of its motion is not 'held'")
            self._check_running()
        try:
            self._apply(part, request)
        except MobeeError as error:
            raise CallRefused("force", str(error)) from None
        return DONE

    def _apply(self, part: str, request: Force) -> None:
        if (request.marker is None) != (request.push is None):
            raise InvalidValue("a push needs both: the marker and the force (marker, push)")
        largest = LARGEST_FORCE / len(self._robot.parts)  # so that the law accepts the sum of all clients' forces
        for number in (*(request.f or ()), *(request.push or ())):
            if abs(number) > largest:
                raise InvalidValue(f"a force of {number:.3g}: its absolute value must be at most {largest:.3g}")
        if request.f is None and request.marker is None:
            self._law.clear_client_forces(part)
            return
        if request.marker is not None:
            if self._robot.marker(request.marker).link not in links_moved(self._robot)[part]:
                raise InvalidValue(f"{part} does not move the marker {request.marker!r}: name a part that does")
            self._law.set_push(part, request.marker, np.array(request.push))
        if request.f is not None:
            self._law.set_client_force(part, np.array(request.f))

    def _check_free(self, part: str) -> None:
        if self._actions[part].is_in_hold:
            raise CallRefused("held", f"{part} is in hold: wait until the status of its motion is not 'held'")

    def _check_running(self) -> None:
        """Refuse a reach or a force in a pause: the hold after the pause would end it. A goal would be suspended, and continue."""
        if self.paused_at is not None:
            raise CallRefused("paused", "the robot is paused, and begins no reach and takes no force: resume it first")

    def _check_epoch(self, part: str, epoch: int) -> None:
        owner = self._actions[part].owner
        if owner is None or owner.epoch != epoch:
            raise CallRefused("epoch", f"epoch {epoch} does not own the goal of {part}: take it first")

    def _check_limits(self, part: str, target: Array) -> None:
        if outside := self._beyond_limits(part, target):
            raise CallRefused("limits", outside)

    def _beyond_limits(self, part: str, target: Array) -> str:
        """Return which motor would leave its range, as a text; empty if none would."""
        limits = self._robot.limits[self._robot.part(part).slice]
        outside = np.flatnonzero((target < limits[:, 0] - 1e-9) | (target > limits[:, 1] + 1e-9))
        if not len(outside):
            return ""
        i = int(outside[0])
        motor = self._robot.motor_table[self._robot.part(part).start + i]
        unit = unit_name(self._robot, motor)
        return f"{motor.name} at {target[i]:.4f} {unit}: its range is {limits[i, 0]:.4f} to {limits[i, 1]:.4f} {unit}"

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        for part, action in self._actions.items():
            if not up and action.owner is not None and action.owner.instance == instance:
                self._service.bus.event("warning", "agent_gone", f"{who} is gone: {part} stays where it is")
                self._end_ownership(part)

    def _end_ownership(self, part: str) -> None:
        self._actions[part].lose_owner(self._service.bus.k)
        self._reaches.interrupt(part)
        self._law.clear_client_forces(part)
        self._law.brake(part)
