# SPDX-License-Identifier: Apache-2.0
"""An upright cylinder, such as a cup, that the robot pushes over a table: the quasi-static model of pushing."""

from __future__ import annotations

from dataclasses import replace
from math import hypot
from typing import TYPE_CHECKING

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.model.engine import NO_HANDS
from mobee.model.model import engine_of
from mobee.model.world import World
from mobee.model.world_object import Geometry, WorldObject, cylinder
from mobee.robot.robot import Robot, per_robot

if TYPE_CHECKING:
    from mobee.simulation.plant import OfflinePlant

Area = tuple[tuple[float, float], tuple[float, float]]
FRICTION = 0.4  # an assumption, about ceramics on wood
PERIOD = 0.04  # s between two checks: a hand at 0.1 m/s, the fastest that was seen, moves by 4 mm
TOLERANCE = 1e-4  # m, depth at which robot and object only touch
ABSENCE = 1.0  # s after which a fallen object is put back
CLEARANCE = 0.03  # m around its first place that must be free of the robot then
MOST_PUSHES = 50  # contacts resolved one after another in a check; more are needed only where it is wedged
FLATTEST = 0.5  # horizontal share of a contact's normal below which the robot presses on the object and does not push it
UPRIGHT = 1e-6


class SlidingObject:
    """An upright cylinder that the robot pushes over a horizontal surface.

    The motion is quasi-static: friction with the surface stops the object at once when nothing pushes it, and its contacts with the robot
    have no friction. Such an object moves in the horizontal direction of a contact's normal until the contact is resolved, and does not
    rotate. It topples if it is pushed higher than radius / friction above the surface, pressed from above, or wedged between solids; it
    falls if its centre leaves the area. A fallen object is removed from the world for one second, and is then put back to its first place
    as soon as no solid of the robot is in this place, or within 3 cm of its side; after a restart of the plant, without the wait. It exerts
    no force on the robot, and other objects do not stop it. `World.move` moves it to another place. While it is attached to a link, it
    moves with the link and is not pushed.

    Args:
        plant: the plant whose motion pushes the object; its callback (`every`) is used for this.
        name: name of an upright cylinder in the plant's world with the role "ghost", so that the controller keeps no distance from it.
        support: name of the box on which it stands.
        friction: coefficient of friction between object and support.
        area: ((x low, x high), (y low, y high)) in m, root frame; the object falls when its centre leaves it; None: the top of the support,
            which may be turned about the vertical.

    Raises:
        UnknownName: the world has no such object.
        InvalidValue: the object is not an upright cylinder with the role "ghost" on the top of an upright box and within the area.
    """

    def __init__(
        self, plant: OfflinePlant, name: str, support: str = "table", friction: float = FRICTION, area: Area | None = None
    ) -> None:
        objects = plant.model.world.objects
        for one in (name, support):
            if one not in objects:
                raise UnknownName("world object", one, objects)
        if not friction > 0.0:
            raise InvalidValue(f"friction={friction!r}: give a coefficient above 0.")
        thing, under = objects[name], objects[support]
        self._surface = _surface(thing, under)
        self.name, self.friction = name, float(friction)
        self._area = _top(under) if area is None else _bounds(area)
        if not self._is_inside(thing.position):
            where = f"the top of {support}" if area is None else f"the area {area}"
            raise InvalidValue(
                f"{name} stands at x, y = {thing.position[:2].tolist()} m, outside of {where}: move it, or give a larger area."
            )
        self._plant, self._engine, self._first = plant, engine_of(_solids(plant.robot)), thing
        self._alone, self._room = _world(thing, 0.0), _world(thing, CLEARANCE)
        self._place: Array | None = thing.position.copy()
        self._fell_at = 0.0
        self.path = 0.0
        """Length of the path over which the robot has pushed the object, m."""
        self.falls = 0
        """Number of times that the object has toppled or left the area."""
        plant.every(max(1, round(PERIOD / plant.dt)), self.check)

    @property
    def place(self) -> Array | None:
        """The position of the object's centre, (3,) m, root frame; None while it is not in the world.

        It is not in the world after a fall, until it is put back, and after the caller has removed it.
        """
        model = self._plant.model
        thing = model.world.objects.get(self.name)
        if thing is not None and thing.link is not None:
            thing = model.evaluate(self._plant.motors.q).objects[self.name]
        return None if thing is None else thing.position.copy()

    def perceive(self) -> dict[str, Array]:
        """Return the exact position of the object (3,) m, root frame, by its name; an empty dict while it is not in the world (`place`).

        Give this method to a `PerceivingPlant` as the argument `perceive`.
        """
        place = self.place
        return {} if place is None else {self.name: place}

    def put_back(self) -> bool:
        """Put the object to its first place, also if it has not fallen or was removed from the world; return whether this was possible.

        If a solid of the robot is in this place, or within 3 cm of its side, nothing changes and False is returned. Raises InvalidValue if
        the object is attached to a link.
        """
        if self._deepest(self._plant.motors.q.tobytes(), self._room) is not None:
            return False
        first, world = self._first, self._plant.model.world
        if self.name not in world.objects:  # fallen, or the caller has removed it
            shape = Geometry(first.kind, first.size)
            world.add(
                self.name, shape, position=first.position, rotation=first.rotation, role=first.role, color=first.color,
                mass=first.mass, friction=first.friction,
            )  # fmt: skip
        else:
            world.move(self.name, position=first.position)
        self._alone.move(self.name, position=first.position)
        self._place = first.position.copy()
        return True

    def check(self, time: float) -> None:
        """Push the object out of the robot's solids; if it has fallen at least 1 s ago, try to put it back.

        The plant calls this method with its `time` [s], about every 0.04 s.
        """
        q = self._plant.motors.q.tobytes()
        if self._place is None:
            if not 0.0 <= time - self._fell_at < ABSENCE:  # below 0 after a restart of the plant
                self.put_back()
            return
        thing = self._plant.model.world.objects.get(self.name)
        if thing is None or thing.link is not None:
            return  # the caller has removed it, or attached it to a link
        there = thing.position
        if (there != self._place).any():  # the caller has moved it
            self._place = there.copy()
            self._alone.move(self.name, position=there)
        found = self._deepest(q, self._alone)
        if found is not None:
            after = self._pushed(q, self._place.copy(), found)
            if after is None:
                self._fall(time)
            else:
                self.path += hypot(*(after - self._place)[:2].tolist())
                self._place = after
                self._plant.model.world.move(self.name, position=after)

    def _pushed(self, q: bytes, place: Array, found: Array | None) -> Array | None:
        """Return the position (3,) m, root frame, to which the robot's solids push the object; None if the object falls.

        It is pushed along the horizontal part of the contact normal until no solid is deeper in it than the tolerance. It falls if a
        contact is too high or its normal nearly vertical, if it leaves its area, or if MOST_PUSHES pushes are not enough. `q`: motor
        positions as bytes. `place`: its position, which is changed. `found`: its deepest contact there, see `_deepest`.
        """
        highest = self._first.size[0] / self.friction
        for _ in range(MOST_PUSHES):
            if found is None:
                return place if self._is_inside(place) else None
            depth, x, y, _, _, _, z = found.tolist()
            flat = hypot(x, y)
            if flat < FLATTEST or z - self._surface > highest:
                return None
            place[0] -= depth / flat * x / flat
            place[1] -= depth / flat * y / flat
            self._alone.move(self.name, position=place)
            found = self._deepest(q, self._alone)
        return None

    def _deepest(self, q: bytes, world: World) -> Array | None:
        """Return depth, normal and point of the robot's deepest contact with the object, (7,); None if none exceeds the tolerance."""
        table = self._engine.contacts_of_one(q, world.snapshot, NO_HANDS)[0]
        if not len(table):
            return None
        deepest: Array = table.reals[table.depth.argmax()]
        return deepest if deepest[0] > TOLERANCE else None

    def _is_inside(self, place: Array) -> bool:
        centre, half, turn = self._area
        return bool((np.abs(turn.T @ (place[:2] - centre)) <= half).all())

    def _fall(self, time: float) -> None:
        self.falls += 1
        self._fell_at, self._place = time, None
        self._plant.model.world.remove(self.name)


def _surface(thing: WorldObject, under: WorldObject) -> float:
    """Return the height [m] of the top of the support; raises InvalidValue unless the thing is an upright cylinder that stands on it."""
    if thing.kind != "cylinder" or abs(thing.rotation[2, 2]) < 1.0 - UPRIGHT or thing.role != "ghost" or thing.link is not None:
        raise InvalidValue(f"{thing.name} is a {thing.kind} of role {thing.role}: what slides is an upright cylinder of role ghost.")
    if under.kind != "box" or under.rotation[2, 2] < 1.0 - UPRIGHT or under.link is not None:
        raise InvalidValue(f"{under.name} is no upright box: give the box on which {thing.name} stands.")
    top, bottom = under.position[2] + 0.5 * under.size[2], thing.position[2] - 0.5 * thing.size[1]
    if abs(top - bottom) > 1e-3:
        raise InvalidValue(
            f"{thing.name} ends {bottom - top:.4g} m above {under.name}: put it on its top, at z = {top + 0.5 * thing.size[1]:.4g} m."
        )
    return float(top)


def _top(under: WorldObject) -> tuple[Array, Array, Array]:
    """Return the top of an upright box, in the plane x, y: centre (2,) m, half of its edges (2,) m, and rotation (2, 2)."""
    return under.position[:2], 0.5 * np.array(under.size[:2]), under.rotation[:2, :2]


def _bounds(area: Area) -> tuple[Array, Array, Array]:
    """Return an area with edges along the axes as `_top` does."""
    low, high = np.array(area).T
    return 0.5 * (low + high), 0.5 * (high - low), np.eye(2)


def _world(thing: WorldObject, wider: float) -> World:
    """Return a world with the object alone, wider by a distance [m] on all sides."""
    world = World()
    world.add(thing.name, cylinder(thing.size[0] + wider, thing.size[1]), position=thing.position, rotation=thing.rotation)
    return world


@per_robot
def _solids(robot: Robot) -> Robot:
    """Return the robot with its solid shapes alone, and without contacts of its shapes with each other."""
    kept = [number for number, shape in enumerate(robot.shapes) if shape.role == "solid"]
    return replace(
        robot,
        shapes=tuple(robot.shapes[number] for number in kept),
        solid_pairs=robot.solid_pairs[:0],
        field_pairs=robot.field_pairs[:0],
        base_shapes=frozenset(new for new, number in enumerate(kept) if number in robot.base_shapes),
    )
