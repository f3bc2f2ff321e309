"""Answers the calls of agents: take a part's goal, set it, apply a force, reach."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from bus_schema import VERSION, keys
from bus_schema.rpc import Done, Force, Goal, ReachFor, Reply, Request, Started, Take, Taken, WithEpoch
from mobee import Controller
from mobee.arrays import Array
from mobee.control.checked import LARGEST_FORCE
from mobee.errors import InvalidValue, MobeeError
from mobee.model.contact import links_moved
from mobee.robot.robot import Robot
from services.common.service import CallRefused, Service
from services.controller.action import Action, Owner
from services.controller.reaches import ReachesUnderWay

DONE = Done(v=VERSION)


_Q = TypeVar("_Q", bound=Request)


def _by_part(handler: Callable[[str, _Q], Reply]) -> Callable[[_Q, str], Reply]:
    return lambda request, key: handler(key.split("/")[0], request)


class GoalDesk:
    """Serves the goals of all parts; an epoch belongs to one owner, and dies with its token."""

    def __init__(
        self,
        service: Service,
        robot: Robot,
        law: Controller,
        actions: dict[str, Action],
        reaches: ReachesUnderWay,
        rest: Callable[[str], None],
        hurry: Callable[[str], None],
    ) -> None:
        """`rest` has a part stay, `hurry` has what was asked of it commanded before the next tick."""
        self._service, self._robot, self._law, self._actions = service, robot, law, actions
        self._reaches, self._rest, self._hurry = reaches, rest, hurry
        self._forces = np.zeros(len(robot.motors))
        self._pushes: dict[str, dict[str, Array]] = {}  # part -> marker -> (3,)
        self._epoch = time.time_ns() // 1_000_000  # newer than any epoch of a controller that died
        service.on_request(keys.goal("*", "take"), Take, _by_part(self._take), part_of_key=True)
        service.on_request(keys.goal("*", "release"), WithEpoch, _by_part(self._release), part_of_key=True)
        service.on_request(keys.goal("*", "goal"), Goal, _by_part(self._goal), part_of_key=True)
        service.on_request(keys.goal("*", "force"), Force, _by_part(self._force), part_of_key=True)
        service.on_request(keys.goal("*", "reach"), ReachFor, _by_part(self._reach), part_of_key=True)
        service.on_alive(self._note)

    def _take(self, part: str, request: Take) -> Taken:
        owner = self._actions[part].owner
        if owner is not None and owner.instance != request.instance and owner.instance in self._service.alive.get(owner.who, ()):
            raise CallRefused("owned", f"the goal of {part} belongs to {owner.who}; it must release it first")
        if request.instance not in self._service.alive.get(request.who, ()):
            raise CallRefused("token", f"no liveliness token alive/{request.who}/{request.instance}: declare it before taking a goal")
        self._epoch += 1
        self._actions[part].owner = Owner(request.who, request.instance, self._epoch)
        return Taken(v=VERSION, epoch=self._epoch)

    def _release(self, part: str, request: WithEpoch) -> Done:
        self._check_epoch(part, request.epoch)
        self._drop(part)
        return DONE

    def _goal(self, part: str, request: Goal) -> Started:
        self._check_epoch(part, request.epoch)
        target = np.array(request.q)
        self._check_limits(part, target)
        self._check_free(part)
        self._reaches.drop(part)
        self._law.set_attractor(part, target)
        return self._start(part, request.action_id)

    def _reach(self, part: str, request: ReachFor) -> Started:
        self._check_epoch(part, request.epoch)
        self._check_free(part)
        try:
            self._reaches.begin(part, request)
        except MobeeError as error:
            raise CallRefused("reach", str(error)) from None
        started = self._start(part, request.action_id)
        self._hurry(part)
        return started

    def _start(self, part: str, action_id: str) -> Started:
        self._actions[part].start(action_id, self._service.bus.k, self._service.bus.t * 1e-9)
        return Started(v=VERSION, k=self._service.bus.k)

    def _force(self, part: str, request: Force) -> Done:
        self._check_epoch(part, request.epoch)
        if self._actions[part].status == "held" and (request.f is not None or request.marker is not None):
            raise CallRefused("held", f"{part} is in hold, in which forces end; wait until its motion says otherwise")
        try:
            self._apply(part, request)
        except MobeeError as error:
            raise CallRefused("force", str(error)) from None
        return DONE

    def _apply(self, part: str, request: Force) -> None:
        if (request.marker is None) != (request.push is None):
            raise InvalidValue("a push needs both, the marker and the force")
        largest = LARGEST_FORCE / len(self._robot.parts)  # so that the law takes their sum, whatever other clients push with
        for number in (*(request.f or ()), *(request.push or ())):
            if abs(number) > largest:
                raise InvalidValue(f"a force of {number:.3g}; must be at most {largest:.3g} in size")
        if request.f is None and request.marker is None:
            self.clear(part)
            return
        if request.marker is not None:
            if self._robot.marker(request.marker).link not in links_moved(self._robot)[part]:
                raise InvalidValue(f"{part} does not move the marker {request.marker!r}: push it through a part that does")
            self._pushes.setdefault(part, {})[request.marker] = np.array(request.push)
        if request.f is not None:
            self._forces[self._robot.part(part).slice] = request.f
        self._exert()

    def end(self, part: str) -> None:
        """The part's client has lost it: its forces end, and its reach; those of the others go on."""
        self._reaches.drop(part)
        self.clear(part)

    def clear(self, part: str) -> None:
        """End the forces of one part's client, but a reach; those of the others go on."""
        self._forces[self._robot.part(part).slice] = 0.0
        self._pushes.pop(part, None)
        self._exert()

    def _exert(self) -> None:
        """Tell the law the sum of what the clients want; several may push at one marker."""
        self._law.clear()
        self._law.force(self._forces)
        at_marker: dict[str, Array] = {}
        for pushes in self._pushes.values():
            for marker, push in pushes.items():
                at_marker[marker] = at_marker.get(marker, 0.0) + push
        for marker, push in at_marker.items():
            self._law.push(marker, push)

    def _check_free(self, part: str) -> None:
        if self._actions[part].status == "held":
            raise CallRefused("held", f"{part} is in hold; wait until its motion says otherwise")

    def _check_epoch(self, part: str, epoch: int) -> None:
        owner = self._actions[part].owner
        if owner is None or owner.epoch != epoch:
            raise CallRefused("epoch", f"epoch {epoch} does not own the goal of {part}: take it first")

    def _check_limits(self, part: str, target: Array) -> None:
        limits = self._robot.limits[self._robot.part(part).slice]
        outside = np.flatnonzero((target < limits[:, 0] - 1e-9) | (target > limits[:, 1] + 1e-9))
        if len(outside):
            i = int(outside[0])
            raise CallRefused(
                "limits",
                f"{self._robot.part(part).motors[i]} to {target[i]:.4f} rad: its range is {limits[i, 0]:.4f} to {limits[i, 1]:.4f}",
            )

    def _note(self, who: str, instance: str, up: bool) -> None:
        for part, action in self._actions.items():
            if not up and action.owner is not None and action.owner.instance == instance:
                self._service.bus.event("warning", "agent_gone", f"{who} is gone: {part} stays where it is")
                self._drop(part)

    def _drop(self, part: str) -> None:
        self._actions[part].drop(self._service.bus.k)
        self.end(part)
        self._rest(part)
