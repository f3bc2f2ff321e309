"""The objects around the robot: they come and go while the model evaluates."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from mobee.collision.geometry import Geometry
from mobee.errors import InvalidValue, UnknownName
from mobee.robot.robot import Array, ShapeKind

Role = Literal["obstacle", "target", "ghost"]
Color = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class WorldObject:
    """A volume in the world.

    `position`, `rotation`: in the root frame; once attached, in the frame of `link`, which is the root frame at zero pose.
    """

    name: str
    kind: ShapeKind
    size: tuple[float, ...]  # as Geometry
    position: Array  # (3,) m
    rotation: Array  # (3, 3)
    role: Role = "obstacle"
    color: Color | None = None  # red, green, blue, opacity in 0..1
    link: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The world between two edits; it never changes."""

    version: int
    objects: Mapping[str, WorldObject]


class World:
    """A set of named objects; every edit makes a new snapshot, so any thread may edit while others evaluate.

    Roles: an "obstacle" repels; a "target" too, except from the link that reaches for it; a "ghost" is only shown.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._snapshot = Snapshot(0, MappingProxyType({}))
        self._link_poses: Mapping[str, Array] = {}

    @property
    def snapshot(self) -> Snapshot:
        """The newest consistent state; reading it takes no lock."""
        return self._snapshot

    @property
    def objects(self) -> Mapping[str, WorldObject]:
        """The newest objects by name, read-only, in the order in which they were added."""
        return self._snapshot.objects

    @property
    def version(self) -> int:
        """How many edits there have been."""
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
    ) -> None:
        """Add an object; position (3,) m and rotation (3, 3) in the root frame; raises InvalidValue if the name is taken."""
        at = _position(name, position)
        turn = np.eye(3) if rotation is None else _rotation(name, rotation)
        new = WorldObject(name, shape.kind, shape.size, at, turn, _role(name, role), _color(name, color))
        with self._lock:
            if name in self._snapshot.objects:
                raise InvalidValue(f"world object {name!r} exists already; move or remove it, or choose another name.")
            self._put(new)

    def move(self, name: str, *, position: ArrayLike | None = None, rotation: ArrayLike | None = None) -> None:
        """Put an object elsewhere in the root frame; what is not given stays.  An attached object must be detached first."""
        at = None if position is None else _position(name, position)
        turn = None if rotation is None else _rotation(name, rotation)
        with self._lock:
            old = self._get(name)
            if old.link is not None:
                raise InvalidValue(f"world object {name!r} is attached to link {old.link!r} and moves with it; detach it first.")
            moved = replace(old, position=old.position if at is None else at, rotation=old.rotation if turn is None else turn)
            self._put(moved)

    def remove(self, name: str) -> None:
        """Take an object away."""
        with self._lock:
            self._get(name)
            self._publish({other: o for other, o in self._snapshot.objects.items() if other != name})

    def set_role(self, name: str, role: Role) -> None:
        """Make an object an "obstacle", a "target" or a "ghost"."""
        valid = _role(name, role)
        with self._lock:
            self._put(replace(self._get(name), role=valid))

    def attach(self, name: str, link: str, relative: tuple[ArrayLike, ArrayLike] | None = None) -> None:
        """Let an object move with a link of the robot, which then no longer touches it.

        `relative`: position (3,) m and rotation (3, 3) in the link's frame, which is the root frame at zero pose.  Without
        it the object stays where it is relative to the link in the pose that a Model of this world evaluated last
        (Model.attach takes the pose explicitly).
        """
        pose = None if relative is None else (_position(name, relative[0]), _rotation(name, relative[1]))
        with self._lock:
            old = self._get(name)
            if pose is None:
                here = old if old.link is None else placed(old, self._link_pose(old.link))
                pose = seen_from(self._link_pose(link), here)
            elif self._link_poses:
                self._link_pose(link)
            self._put(replace(old, position=pose[0], rotation=pose[1], link=link))

    def detach(self, name: str) -> None:
        """Leave an attached object where it is in the pose that a Model of this world evaluated last."""
        with self._lock:
            old = self._get(name)
            if old.link is None:
                raise InvalidValue(f"world object {name!r} is not attached to any link.")
            self._put(placed(old, self._link_pose(old.link)))

    def follow(self, link_poses: Mapping[str, Array]) -> None:
        """Told by a Model at every single-pose evaluation: the (4, 4) pose of every link, by name."""
        self._link_poses = link_poses

    def _link_pose(self, link: str) -> Array:
        poses = self._link_poses
        if not poses:
            raise InvalidValue(f"where link {link!r} is, no model has said yet: evaluate a pose first, or give `relative`.")
        if link not in poses:
            raise UnknownName("link", link, poses)
        return poses[link]

    def _get(self, name: str) -> WorldObject:
        if name not in self._snapshot.objects:
            raise UnknownName("world object", name, self._snapshot.objects)
        return self._snapshot.objects[name]

    def _put(self, new: WorldObject) -> None:
        self._publish({**self._snapshot.objects, new.name: new})

    def _publish(self, objects: dict[str, WorldObject]) -> None:
        self._snapshot = Snapshot(self._snapshot.version + 1, MappingProxyType(objects))


def placed(thing: WorldObject, link_pose: Array) -> WorldObject:
    """An attached object as a free one, where its link (4, 4) carries it now."""
    turn, shift = link_pose[:3, :3], link_pose[:3, 3]
    return replace(thing, position=turn @ thing.position + shift, rotation=turn @ thing.rotation, link=None)


def seen_from(link_pose: Array, thing: WorldObject) -> tuple[Array, Array]:
    """Position (3,) and rotation (3, 3) of a free object in the frame of a link at (4, 4)."""
    back = link_pose[:3, :3].T
    return back @ (thing.position - link_pose[:3, 3]), back @ thing.rotation


def _position(name: str, given: ArrayLike) -> Array:
    value = np.array(given, dtype=np.float64)
    if value.shape != (3,) or not np.isfinite(value).all():
        raise InvalidValue(f"world object {name!r}: position {given!r}; it must be three finite numbers in metres.")
    return value


def _rotation(name: str, given: ArrayLike) -> Array:
    value = np.array(given, dtype=np.float64)
    if value.shape != (3, 3) or not np.allclose(value @ value.T, np.eye(3), atol=1e-6) or np.linalg.det(value) < 0.0:
        raise InvalidValue(f"world object {name!r}: rotation {given!r}; it must be a (3, 3) rotation matrix.")
    return value


def _role(name: str, role: Role) -> Role:
    if role not in get_args(Role):
        raise InvalidValue(f"world object {name!r}: role {role!r}; valid: {', '.join(get_args(Role))}.")
    return role


def _color(name: str, given: Sequence[float] | None) -> Color | None:
    if given is None:
        return None
    channels = tuple(float(c) for c in given)
    if len(channels) == 3:
        channels = (*channels, 1.0)
    if len(channels) != 4 or not all(0.0 <= c <= 1.0 for c in channels):
        raise InvalidValue(f"world object {name!r}: color {given!r}; it must be red, green, blue and optionally opacity, each 0 to 1.")
    return channels[0], channels[1], channels[2], channels[3]
