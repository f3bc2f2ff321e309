"""The egocentric model: what the robot, in a pose, feels of itself and of the world (thesis chapter 2)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from mobee.collision.contact import Contact, ContactTable
from mobee.collision.snapshot import Snapshot
from mobee.collision.world import World
from mobee.collision.world_object import WorldObject, placed, seen_from
from mobee.engine import engine_of
from mobee.errors import InvalidValue, UnknownName
from mobee.kinematics.jacobian import point_jacobian
from mobee.robot.robot import Array, Ints, Robot

if TYPE_CHECKING:
    from mobee.engine.track import Track


class Finder(Protocol):
    """What finds contacts."""

    def contacts(self, q: Array, snapshot: Snapshot, reaching: int) -> tuple[ContactTable, Array]:
        """All contacts in the poses q (B, n), and the projected depths of those of fields, (B, n)."""


class Engine(Protocol):
    """What evaluates poses: the compiled engine, or python-fcl as its exact reference."""

    def transforms(self, q: Array) -> Array:
        """Every link in the poses q (B, n), (B, L, 4, 4)."""

    def jacobians(self, q: Array, link: int, point: Array) -> Array:
        """How a link's point (3,), root frame at zero pose, moves with each motor in the poses q (B, n), (B, 6, n)."""

    def contacts(self, q: Array, snapshot: Snapshot, reaching: int, cut: bool = False) -> tuple[ContactTable, Array]:
        """All contacts in the poses q (B, n), and the projected depths of those of fields, (B, n)."""


class Pose:
    """The robot at one q or at a batch of them, in the world as it was when `Model.evaluate` was called.

    `q`: (..., n) rad.  What is asked for is computed when it is first asked for, and kept.
    """

    # Kept by hand: functools.cached_property takes one lock for all poses before Python 3.12, and no evaluation may wait for another.

    def __init__(self, robot: Robot, engine: Engine, q: Array, snapshot: Snapshot, reaching: int) -> None:
        self.robot = robot
        self.q = q
        self._engine = engine
        self._snapshot = snapshot
        self._reaching = reaching
        self._transforms: Array | None = None
        self._felt: tuple[ContactTable, Array] | None = None
        self._contacts: tuple[Contact, ...] | None = None

    @property
    def transforms(self) -> Array:
        """Where every link has gone: (..., L, 4, 4), from the root frame at zero pose to now."""
        if self._transforms is None:
            found = self._engine.transforms(self._flat)
            self._transforms = found.reshape(*self.q.shape[:-1], *found.shape[1:])
        return self._transforms

    def position(self, marker: str) -> Array:
        """Where a marker is, (..., 3) m in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        link = self.transforms[..., m.link, :3, :]
        return link[..., :3] @ m.position + link[..., 3]

    def rotation(self, marker: str) -> Array:
        """How a marker is turned, (..., 3, 3) in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.rotation

    def normal(self, marker: str) -> Array:
        """Where a marker's normal points, (..., 3) unit vector in the root frame; raises UnknownName."""
        m = self.robot.marker(marker)
        return self.transforms[..., m.link, :3, :3] @ m.normal

    def point_jacobian(self, link: int, point: Array) -> Array:
        """How a point (..., 3) m, root frame now, fixed to a link moves per motor: (..., 6, n), linear rows then angular."""
        return point_jacobian(self.robot, self.transforms, link, point)

    @property
    def table(self) -> ContactTable:
        """Every overlap of the tested pairs in every pose, as columns."""
        return self._feel()[0]

    @property
    def projection(self) -> Array:
        """The contacts of fields as the motors see them: sum of J^T (depth * normal), (..., n) in [m^2/rad] (thesis eq. 5.11).

        Both sides of a self contact get opposite vectors, and all motors down to the base feel it.
        """
        return self._feel()[1].reshape(self.q.shape)

    @property
    def projection_of_part(self) -> Array:
        """The projection, cut where a part ends, as in the original program: an arm's contact does not reach the torso."""
        return self._engine.contacts(self._flat, self._snapshot, self._reaching, cut=True)[1].reshape(self.q.shape)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """Every overlap of the tested pairs, solids before fields; one pose only (InvalidValue for a batch)."""
        if self.q.ndim != 1:
            raise InvalidValue(f"contacts belong to one pose, and this is a batch of shape {self.q.shape}; use table, or evaluate one q.")
        if self._contacts is None:
            self._contacts = self.table.contacts()
        return self._contacts

    @property
    def count(self) -> int | Ints:
        """How many solid contacts: an int for one pose, (...,) integers for a batch."""
        table = self.table
        counted = np.bincount(table.pose[table.kind == 0], minlength=len(self._flat))
        return int(counted[0]) if self.q.ndim == 1 else counted.reshape(self.q.shape[:-1])

    @property
    def objects(self) -> dict[str, WorldObject]:
        """The world's objects as this evaluation saw them; one pose only: attached ones are where their link carries them."""
        links = self.robot.links
        return {
            name: thing if thing.link is None else placed(thing, self.transforms[links.index(thing.link)])
            for name, thing in self._snapshot.objects.items()
        }

    def feel(self, finder: Finder) -> None:
        """Have the contacts found now, and by other means than the model's own."""
        self._felt = finder.contacts(self._flat, self._snapshot, self._reaching)

    @property
    def _flat(self) -> Array:
        return self.q.reshape(-1, self.q.shape[-1])

    def _feel(self) -> tuple[ContactTable, Array]:
        if self._felt is None:
            self._felt = self._engine.contacts(self._flat, self._snapshot, self._reaching)
        return self._felt


class Model:
    """A robot in a world; evaluates poses, in any number of threads, while other threads edit the world.

    Each evaluation sees one consistent state of the world and never waits for an edit.  `engine`: "compiled", or "fcl", the
    slow reference.
    """

    def __init__(self, robot: Robot, world: World | None = None, engine: Literal["compiled", "fcl"] = "compiled") -> None:
        self.robot = robot
        self.world = World() if world is None else world
        self._engine = _engine(robot, engine)
        self._motors = len(robot.motor_table)
        self._reaching: str | None = None
        self._reaching_link = -1

    @property
    def reaching(self) -> str | None:
        """The marker that reaches for the targets, so that its link does not feel them; None: no reach is active."""
        return self._reaching

    @reaching.setter
    def reaching(self, marker: str | None) -> None:
        self._reaching_link = -1 if marker is None else self.robot.marker(marker).link
        self._reaching = marker

    def evaluate(self, q: ArrayLike) -> Pose:
        """The pose at q, (n,) or (..., n) rad in the order of robot.motors; raises InvalidValue for any other shape or NaN."""
        value = self._checked(q)
        pose = Pose(self.robot, self._engine, value, self.world.snapshot, self._reaching_link)
        if value.ndim == 1:
            self.world.follow(pose)
        return pose

    def track(self, skin: float = 0.02) -> Track:
        """An evaluator for poses that follow each other closely, as while the robot moves; one for each thread.

        `skin` m: pairs nearer than this are kept in a list.  The reference engine, python-fcl, has none and evaluates as ever.
        """
        if not 0.0 < skin < math.inf:
            raise InvalidValue(f"skin {skin} m: must be a finite distance above 0")
        from mobee.engine.track import Track

        return Track(self.evaluate, self._engine, skin)

    def jacobian(self, q: ArrayLike, marker: str) -> Array:
        """The marker's Jacobian, (..., 6, n): linear rows [m/rad] then angular, root frame, per motor (thesis eq. 5.1)."""
        value = self._checked(q)
        m = self.robot.marker(marker)
        found = self._engine.jacobians(value.reshape(-1, self._motors), m.link, m.position)
        return found.reshape(*value.shape[:-1], 6, self._motors)

    def attach(self, name: str, link: str, q: ArrayLike) -> None:
        """Let a world object move with a link from where both are in the pose q (n,) rad."""
        pose = self.evaluate(q)
        if link not in self.robot.links:
            raise UnknownName("link", link, self.robot.links)
        if name not in pose.objects:
            raise UnknownName("world object", name, pose.objects)
        link_pose = pose.transforms[self.robot.links.index(link)]
        self.world.attach(name, link, seen_from(link_pose, pose.objects[name]))

    def _checked(self, q: ArrayLike) -> Array:
        value = np.array(q, dtype=np.float64, order="C")
        n = self._motors
        if value.ndim == 0 or value.shape[-1] != n:
            raise InvalidValue(f"q has shape {value.shape}; {self.robot.name!r} has {n} motors, so it must be ({n},) or (..., {n}) rad.")
        # For one pose the first test takes a tenth of the second's time; for many it would wake the threads of BLAS.
        if not (value.ndim == 1 and math.isfinite(value.dot(value))) and not np.isfinite(value).all():
            where = np.argwhere(~np.isfinite(value))[0]
            raise InvalidValue(f"q of motor {self.robot.motors[where[-1]]!r} is {value[tuple(where)]}; it must be a finite angle in rad.")
        return value


def _engine(robot: Robot, name: str) -> Engine:
    if name == "compiled":
        return engine_of(robot)
    if name == "fcl":
        from mobee.collision.fcl_engine import FclEngine

        return FclEngine(robot)
    raise UnknownName("engine", name, ("compiled", "fcl"))
