# SPDX-License-Identifier: Apache-2.0
"""The world: named objects around the robot, which any thread may edit while others evaluate."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.model.engine import EMPTY, Snapshot, changed, extended, shortened
from mobee.model.world_object import (
    FRICTION,
    Color,
    Geometry,
    Role,
    WorldObject,
    placed,
    seen_from,
    valid_color,
    valid_friction,
    valid_mass,
    valid_name,
    valid_position,
    valid_role,
    valid_rotation,
    valid_shape,
)
from mobee.robot.robot import Robot

__all__ = ["Color", "Role", "Snapshot", "World", "WorldObject", "placed", "seen_from"]


class LinkPoses(Protocol):
    """One pose of a robot, as `Model.evaluate` returns it."""

    @property
    def robot(self) -> Robot:
        """The robot that has this pose."""

    @property
    def transforms(self) -> Array:
        """The transform of every link, (L, 4, 4), which maps a point's position at zero pose to its position in this pose, root frame."""


class World:
    """A set of named objects around the robot; any thread may edit it while others evaluate, because every edit makes a new snapshot.

    Roles of an object: an "obstacle" repels the robot; a "target" repels all links except the hand that reaches for it; a "ghost" is only
    drawn. Worlds can be copied (`copy.copy`) and pickled; edits of a copy do not change the original.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._snapshot = EMPTY
        self._followed: LinkPoses | None = None

    def __reduce__(self) -> tuple[Callable[..., World], tuple[type[World], tuple[WorldObject, ...]]]:
        """Copy or pickle the objects; a copy does not know the present pose of the robot (see `follow`)."""
        return _world_of, (type(self), tuple(self._snapshot.objects.values()))

    @property
    def snapshot(self) -> Snapshot:
        """The newest snapshot, an immutable copy of the world; reading it does not wait for an edit."""
        return self._snapshot

    @property
    def objects(self) -> Mapping[str, WorldObject]:
        """The objects of the world by name, read-only, in the order in which they were added."""
        return self._snapshot.objects

    @property
    def version(self) -> int:
        """The number of edits of the world so far."""
        return self._snapshot.version

    def add(
        self,
        name: str,
        shape: Geometry,
        *,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike | None = None,
        role: Role = "obstacle",
        color: Sequence[float] | None = None,
        mass: float | None = None,
        friction: float = FRICTION,
    ) -> None:
        """Add an object at `position` (3,) m with `rotation` (3, 3), root frame; `rotation` None: not rotated.

        `role`: "obstacle", "target" or "ghost". `color`: red, green, blue and optionally opacity, each 0 to 1; None: not stated. `mass`:
        kg; with a mass, the physics engine MuJoCo moves the object when it is pushed, with this coefficient of `friction`; None: it does
        not move. The model and the offline plant do not use mass and friction: for them every object stays where it was put. Raises
        InvalidValue if the name is taken or empty, or a value is not valid.
        """
        valid_name(name)
        volume, at = valid_shape(name, shape), valid_position(name, position)
        turn = np.eye(3) if rotation is None else valid_rotation(name, rotation)
        new = WorldObject(
            name, volume.kind, volume.size, at, turn, valid_role(name, role), valid_color(name, color),
            mass=valid_mass(name, mass), friction=valid_friction(name, friction),
        )  # fmt: skip
        with self._lock:
            if name in self._snapshot.objects:
                raise InvalidValue(f"world object {name!r} exists already; move or remove it, or choose another name.")
            self._snapshot = extended(self._snapshot, new)

    def move(self, name: str, *, position: ArrayLike | None = None, rotation: ArrayLike | None = None) -> None:
        """Set the position (3,) m, the rotation (3, 3) or both of an object, in the root frame; None: it is not changed.

        Raises UnknownName for an unknown object, and InvalidValue for an attached one, or for a position or rotation that is not valid.
        """
        at = None if position is None else valid_position(name, position)
        turn = None if rotation is None else valid_rotation(name, rotation)
        with self._lock:
            old = self._get(name)
            if old.link is not None:
                raise InvalidValue(f"world object {name!r} is attached to link {old.link!r} and moves with it; detach it first.")
            moved = replace(old, position=old.position if at is None else at, rotation=old.rotation if turn is None else turn)
            self._snapshot = changed(self._snapshot, moved)

    def remove(self, name: str) -> None:
        """Remove an object from the world; raises UnknownName if there is no object with this name."""
        with self._lock:
            self._get(name)
            self._snapshot = shortened(self._snapshot, name)

    def set_role(self, name: str, role: Role) -> None:
        """Make an object an "obstacle", a "target" or a "ghost".

        Raises UnknownName for an unknown object, InvalidValue for another role.
        """
        valid = valid_role(name, role)
        with self._lock:
            self._snapshot = changed(self._snapshot, replace(self._get(name), role=valid))

    def attach(self, name: str, link: str, relative: tuple[ArrayLike, ArrayLike] | None = None) -> None:
        """Attach an object to a link of the robot: it moves with the link, and contacts between the two are ignored.

        `relative`: position (3,) m and rotation (3, 3) of the object in the link's frame, which coincides with the root frame at zero pose.
        None: the object keeps its place relative to the link in the pose that was last given to `follow`. (`Model.attach` has the pose as
        an argument.) Raises UnknownName for an unknown object, or for an unknown link if a pose is known. Raises InvalidValue for values
        that are not valid, or if a pose is needed and none is known.
        """
        pose = None if relative is None else (valid_position(name, relative[0]), valid_rotation(name, relative[1]))
        with self._lock:
            old = self._get(name)
            if pose is None:
                seen = self._followed  # once: both links in the same pose
                here = old if old.link is None else placed(old, link_pose(seen, old.link))
                pose = seen_from(link_pose(seen, link), here)
            elif self._followed is not None:
                link_pose(self._followed, link)
            self._snapshot = changed(self._snapshot, replace(old, position=pose[0], rotation=pose[1], link=link))

    def detach(self, name: str) -> None:
        """Detach an object from its link. It then stays where the link holds it in the pose that was last given to `follow`.

        Raises UnknownName, and InvalidValue if the object is not attached or no pose is known.
        """
        with self._lock:
            old = self._get(name)
            if old.link is None:
                raise InvalidValue(f"world object {name!r} is not attached to any link.")
            self._snapshot = changed(self._snapshot, placed(old, link_pose(self._followed, old.link)))

    def follow(self, pose: LinkPoses) -> None:
        """Set the present pose of the robot (one pose, not a batch), from which `attach` and `detach` take the positions of links."""
        self._followed = pose

    def _get(self, name: str) -> WorldObject:
        if name not in self._snapshot.objects:
            raise UnknownName("world object", name, self._snapshot.objects)
        return self._snapshot.objects[name]


def _world_of(kind: type[World], objects: tuple[WorldObject, ...]) -> World:
    world = kind()
    for thing in objects:
        world._snapshot = extended(world._snapshot, replace(thing))  # replaced, so that arrays that were pickled are protected again
    return world


def link_pose(seen: LinkPoses | None, link: str) -> Array:
    """Return the transform (4, 4) of the named link, from its place at zero pose to its place in a pose of the robot, root frame.

    `seen`: the pose; None: no pose is known, which raises InvalidValue, as a batch of poses does. Raises UnknownName for an unknown link.
    """
    if seen is None:
        raise InvalidValue(
            f"the world does not know where link {link!r} is: call world.follow(model.evaluate(q)) first, or give `relative`."
        )
    links = seen.robot.links
    if link not in links:
        raise UnknownName("link", link, links)
    if seen.transforms.ndim != 3:
        raise InvalidValue(
            f"link {link!r} in a batch of poses, of shape {seen.transforms.shape[:-3]}: it has one place in one pose only; "
            "give world.follow, or read objects of, model.evaluate(q) with one q."
        )
    pose: Array = seen.transforms[links.index(link)]
    return pose
