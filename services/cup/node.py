# SPDX-License-Identifier: Apache-2.0
"""Fetches a cup or another object: plans motions of hand and arm stepwise, from positions found by vision; pauses after an error."""

from __future__ import annotations

import time

import numpy as np

from bus_schema import keys
from bus_schema.messages import Role, WorldObject
from bus_schema.rpc import Done, Empty, ObjectState, SetRole
from bus_schema.rpc import World as WorldReply
from mobee.arrays import Array
from mobee.behaviours.grasp import SideGrasp
from mobee.behaviours.pick import FAST, NoPosture, Picker, Upright, places_near
from mobee.behaviours.pre_grasp import ASIDE, MOTORS, WATCHED, MapPlanner, approach, aside, icub_starts, pre_grasp_map
from mobee.control.gains import Gains
from mobee.errors import MobeeError
from mobee.model.kinematics import matrix_from_quaternion
from mobee.model.model import Model
from mobee.model.world import World
from mobee.model.world_object import Geometry
from mobee.robot.robot import Robot
from services.common.rpc import CallFailed
from services.common.service import Service
from services.cup.body import BusBody
from services.cup.config import Config

PARTS = ("torso", "right_arm")
TRIES = 3  # of a call
PAUSE = 0.5  # s of real time between two checks while it waits
MARGIN = 0.004  # m, by which things are enlarged in plans, beside the uncertainty of their places
SHIFTS, GOALS = (0.07, 0.16), 24  # m, of a new place from the old one; places that are tried
AREA = ((-0.45, -0.24), (-0.08, 0.24))  # m, on the table, in which the right hand puts things down
APART = 0.1  # m, of a new place from other things
ARRIVED = 0.04  # m, of the cup from its goal, by vision
SLIP = 0.05  # m: a thing that is seen farther away from where the hand holds it is not in the hand
LOOK = 8.0  # s of the robot's clock for which it looks for the cup at the end


class Paused(MobeeError):
    """Raised if the thing to fetch is not seen any more, so that the hand must stop."""


class CupNode:
    """Fetches an upright object that vision finds (the thing), and puts it down elsewhere, until it has done so `config.times` times."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._service, self._config, self._robot = service, config, robot
        self._status, self._done, self._failed = f"waits: no place of {config.target} yet", 0, 0
        self._seen: WorldObject | None = None
        self._hidden = False  # the hand hides it: the model's world, which keeps it for a while, is enough
        self._gripped = False  # the hand has closed around it: it moves with the hand, seen or not
        self._planned = World()
        service.describe, service.mark = self._describe, lambda: None
        service.on_newest(WorldObject, self._note, config.target)
        service.on_run(self._forget)
        self._body = BusBody(service, robot, PARTS, Gains.named(config.gains), self._require_seen)
        table, self._ground = _only_obstacles(config.load_world()), config.ground()
        self._grasp = SideGrasp(Model(robot, table), config.marker, MOTORS, icub_starts(robot))
        self._map = pre_grasp_map(self._grasp, self._ground)

    def run(self) -> None:
        """Fetch the object `config.target` and put it down elsewhere, until `config.times` times have succeeded; retry after an error."""
        self._service.ready()
        while self._done < self._config.times:
            try:
                self._fetch()
            except (MobeeError, CallFailed) as error:
                self._pause(str(error))
            self._service.spin(time.monotonic() + PAUSE)
            self._service.check_router()

    def _fetch(self) -> None:
        """Fetch the thing once; raises Paused and what the steps raise."""
        self._hidden = self._gripped = False
        self._require_seen()
        self._report("takes torso and right arm")
        self._body.take(PARTS)
        try:
            picker = self._picker()
            self._go_aside(picker)
            thing = self._thing()
            self._report("reaches the pre-grasp")
            picker = self._picker()
            self._hidden = True  # from now on the hand may be before it
            self._set_roles("ghost")
            found = approach(picker.body, picker, thing, self._planner(picker))
            if found.azimuth is None:
                raise NoPosture(f"no path to a pre-grasp beside {self._config.target}, after {found.plans} plans and {found.bumps} bumps")
            self._planned.set_role(self._config.target, "ghost")
            thing = self._thing()
            self._report("closes the hand")
            picker.close(thing, found.azimuth)
            self._gripped = True
            self._report("lifts it")
            picker.lift(thing, found.azimuth)
            self._report("puts it down")
            goal = picker.put(thing, self._goals(thing, found.azimuth), self._centre(picker, thing))
            self._set_roles("target")
            self._go_aside(self._picker())  # without pictures of it: the hand hid it until now
            self._gripped = False
            self._look(goal)
        finally:
            self._set_roles("target")
            self._body.let_go()

    def _picker(self) -> Picker:
        """Return a picker in the world as the model knows it now, with the things enlarged."""
        world = _only_obstacles(self._config.load_world())
        for item in self._objects():
            if item.role != "obstacle":
                margin = MARGIN - (item.margin if item.name == self._config.target else 0.0)  # beside it thumb and fingers have little room
                grown = Geometry(item.geometry.kind, tuple(item.geometry.size)).grown(margin)
                turn = matrix_from_quaternion(np.array(item.quaternion))
                world.add(item.name, grown, position=item.position, rotation=turn, role="target")
        self._planned = world
        # While it fetches, the things are ghosts in the model's world: their fields do not push.
        pushing = self._grasp.model
        grasp = SideGrasp(Model(self._robot, world), self._config.marker, MOTORS, icub_starts(self._robot), pushing)
        return Picker(self._body, grasp, WATCHED)

    def _planner(self, picker: Picker) -> MapPlanner:
        return MapPlanner(self._map, picker.grasp.model, self._config.marker)

    def _go_aside(self, picker: Picker) -> None:
        """Move the hand to the side of the table, around what is seen, so that it hides nothing."""
        self._report("moves its hand aside")
        away = aside(self._map, self._ground, picker.grasp.grip)
        place, here = picker.grasp.model.evaluate(away).position(self._config.marker), self._body.q
        path = self._planner(picker).path(np.clip(here, *self._robot.limits.T), away, ASIDE[-1], np.empty((0, 3)))
        if path is None:
            raise NoPosture(f"no free motion to {place.round(2).tolist()} m, at the side of the table")
        picker.body.follow_path(path, FAST)

    def _thing(self) -> Upright:
        """Return the thing where vision has it; raises Paused."""
        self._require_seen()
        seen = self._seen
        if seen is None:
            raise Paused(f"no place of {self._config.target} yet")
        return Upright(np.array(seen.position[:2]), float(seen.geometry.size[0]), float(seen.geometry.size[1]), self._ground)

    def _centre(self, picker: Picker, thing: Upright) -> Array | None:
        """Return where the thing in the hand is seen, (3,) m; None if the hand hides it."""
        seen = self._seen
        if seen is None or 1e-9 * (self._service.bus.t - seen.t_capture) > self._config.fresh:
            return None
        centre = np.array(seen.position)
        return centre if np.linalg.norm(picker.slipped(thing, centre)) < SLIP else None

    def _goals(self, thing: Upright, azimuth: float) -> list[Array]:
        """Return random places, each (2,) m in the root frame, to which the thing on the table can be moved, far from all other things.

        `azimuth`: direction that the palm faced in the grasp [rad], see `places_near`. The list can be empty.
        """
        rng = np.random.default_rng([self._config.seed, self._done, 437])
        places = places_near(thing.place, azimuth, SHIFTS, GOALS, rng)
        others = [
            item.position[:2] for name, item in self._planned.objects.items() if item.role == "target" and name != self._config.target
        ]
        within = [place for place in places if all(low < x < high for x, (low, high) in zip(place, AREA, strict=True))]
        return [place for place in within if all(np.linalg.norm(place - other) > APART for other in others)]

    def _look(self, goal: Array) -> None:
        """Look where the thing is, and report whether it is at its goal."""
        self._report("looks")
        self._hidden, before = True, self._seen.t_capture if self._seen is not None else -1
        end = self._service.bus.t + round(LOOK * 1e9)
        while self._service.bus.t < end and (self._seen is None or self._seen.t_capture <= before):
            self._service.spin(time.monotonic() + 0.1)
        seen = self._seen
        apart = np.inf if seen is None or seen.t_capture <= before else float(np.linalg.norm(np.array(seen.position[:2]) - goal))
        name = self._config.target
        if apart <= ARRIVED:
            self._done += 1
            self._service.bus.event("info", "cup_placed", f"{name} stands {1e3 * apart:.0f} mm from its new place", distance=apart)
            self._report(f"has put {name} down {self._done} times")
            return
        self._failed += 1
        where = "is not seen" if not np.isfinite(apart) else f"is {1e3 * apart:.0f} mm from its new place"
        self._service.bus.event("warning", "cup_missed", f"{name} {where}")

    def _require_seen(self) -> None:
        """Handle waiting messages, then raise Paused unless the thing was seen a moment ago, is hidden by the hand, or is in the hand.

        A thing that vision has withdrawn does not count as hidden.
        """
        if self._gripped:
            return
        self._service.spin(time.monotonic())  # after a long computation a picture waits behind the clock
        seen, now = self._seen, self._service.bus.t
        if seen is None:
            raise Paused(f"no place of {self._config.target} yet")
        if seen.valid_until < now:
            raise Paused(f"{self._config.target} is stale: vision has withdrawn it")
        if not self._hidden and 1e-9 * (now - seen.t_capture) > self._config.fresh:
            raise Paused(f"no picture of {self._config.target} for {self._config.fresh:g} s")

    def _objects(self) -> list[ObjectState]:
        return self._service.call(keys.world_rpc("list"), Empty, WorldReply, tries=TRIES).objects

    def _set_roles(self, role: Role) -> None:
        """Set the role of all things that vision has found, in the world of the service `model`.

        The hand can grasp a "ghost", since it has no field (volume of repulsive force). Only the planned motions then keep the hand away
        from a ghost that it must not touch.
        """
        try:
            for item in self._objects():
                if item.role not in ("obstacle", role):
                    self._service.call(keys.world_rpc("role"), SetRole, Done, tries=TRIES, name=item.name, role=role)
        except CallFailed as error:
            self._service.log.info("roles were not set to %s: %s", role, error)

    def _note(self, seen: WorldObject) -> None:
        self._seen = seen

    def _forget(self) -> None:
        self._seen = None

    def _report(self, status: str) -> None:
        if status != self._status:
            self._status = status
            self._service.bus.event("info", "cup_step", f"{self._service.who} {status}")

    def _pause(self, why: str) -> None:
        if f"pauses: {why}" != self._status:
            self._status = f"pauses: {why}"
            self._service.bus.event("warning", "cup_pauses", f"{self._service.who} {self._status}")

    def _describe(self) -> tuple[str, dict[str, float]]:
        return self._status, {"placed": self._done, "missed": self._failed}


def _only_obstacles(world: World) -> World:
    """Return the world without the things that vision finds."""
    for name, item in list(world.objects.items()):
        if item.role != "obstacle":
            world.remove(name)
    return world
