"""The egocentric model: what the robot, in a pose, feels of itself and of the world (thesis chapter 2)."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from mobee.collision.contact import Contact
from mobee.collision.scene import Scene, body, scene
from mobee.collision.world import Snapshot, World, WorldObject, placed, seen_from
from mobee.errors import InvalidValue, UnknownName
from mobee.kinematics.forward import link_transforms
from mobee.kinematics.jacobian import point_jacobian
from mobee.robot.robot import Array, Ints, Robot


class Pose:
    """The robot at one q or at a batch of them, in the world as it was when `Model.evaluate` was called.

    `q`: (..., n) rad.  `transforms`: (..., L, 4, 4), from the root frame at zero pose to now.  Contacts are computed when
    first asked for.
    """

    def __init__(self, q: Array, transforms: Array, scene: Scene, snapshot: Snapshot) -> None:
        self.robot = scene.robot
        self.q = q
        self.transforms = transforms
        self._scene = scene
        self._snapshot = snapshot

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

    @cached_property
    def contacts(self) -> tuple[Contact, ...]:
        """Every overlap of the tested pairs, solids before fields; one pose only (InvalidValue for a batch)."""
        if self.q.ndim != 1:
            raise InvalidValue(f"contacts belong to one pose, and this is a batch of shape {self.q.shape}; use count, or evaluate one q.")
        return self._scene.contacts(self.transforms)

    @cached_property
    def count(self) -> int | Ints:
        """How many solid contacts: an int for one pose, (...,) integers for a batch."""
        if self.q.ndim == 1:
            return sum(contact.kind == "solid" for contact in self.contacts)
        flat = self.transforms.reshape(-1, *self.transforms.shape[-3:])
        return np.array([self._scene.solid_count(one) for one in flat], dtype=np.intp).reshape(self.q.shape[:-1])

    @property
    def objects(self) -> dict[str, WorldObject]:
        """The world's objects as this evaluation saw them; one pose only: attached ones are where their link carries them."""
        links = self.robot.links
        return {
            name: thing if thing.link is None else placed(thing, self.transforms[links.index(thing.link)])
            for name, thing in self._snapshot.objects.items()
        }


class Model:
    """A robot in a world; evaluates poses while other threads edit the world.

    Each evaluation sees one consistent state of the world and never waits for an edit.
    """

    def __init__(self, robot: Robot, world: World | None = None) -> None:
        self.robot = robot
        self.world = World() if world is None else world
        self._body = body(robot)
        self._reaching: str | None = None
        self._scene: tuple[Snapshot, str | None, Scene] | None = None

    @property
    def reaching(self) -> str | None:
        """The marker that reaches for the targets, so that its link does not feel them; None: no reach is active."""
        return self._reaching

    @reaching.setter
    def reaching(self, marker: str | None) -> None:
        if marker is not None:
            self.robot.marker(marker)
        self._reaching = marker

    def evaluate(self, q: ArrayLike) -> Pose:
        """The pose at q, (n,) or (..., n) rad in the order of robot.motors; raises InvalidValue for any other shape or NaN."""
        value = self._checked(q)
        transforms = link_transforms(self.robot, value)
        seen, snapshot = self._current_scene()
        if value.ndim == 1:
            self.world.follow(dict(zip(self.robot.links, transforms, strict=True)))
        return Pose(value, transforms, seen, snapshot)

    def jacobian(self, q: ArrayLike, marker: str) -> Array:
        """The marker's Jacobian, (..., 6, n): linear rows [m/rad] then angular, root frame, per motor (thesis eq. 5.1)."""
        value = self._checked(q)
        transforms = link_transforms(self.robot, value)
        m = self.robot.marker(marker)
        link = transforms[..., m.link, :3, :]
        return point_jacobian(self.robot, transforms, m.link, link[..., :3] @ m.position + link[..., 3])

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
        value = np.array(q, dtype=np.float64)
        n = len(self.robot.motor_table)
        if value.ndim == 0 or value.shape[-1] != n:
            raise InvalidValue(f"q has shape {value.shape}; {self.robot.name!r} has {n} motors, so it must be ({n},) or (..., {n}) rad.")
        if not np.isfinite(value).all():
            where = np.argwhere(~np.isfinite(value))[0]
            raise InvalidValue(f"q of motor {self.robot.motors[where[-1]]!r} is {value[tuple(where)]}; it must be a finite angle in rad.")
        return value

    def _current_scene(self) -> tuple[Scene, Snapshot]:
        snapshot, reaching, cached = self.world.snapshot, self._reaching, self._scene
        if cached is not None and cached[0] is snapshot and cached[1] == reaching:
            return cached[2], snapshot
        link = None if reaching is None else self.robot.marker(reaching).link
        built = scene(self.robot, self._body, snapshot, link)
        self._scene = (snapshot, reaching, built)
        return built, snapshot
