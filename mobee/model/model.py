# SPDX-License-Identifier: Apache-2.0
"""Computes link poses, contacts, and contact forces projected to the motors, for joint configurations (thesis chapter 2)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, checked_threads, is_number, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.model.engine import EMPTY, MAX_HANDS, NO_HANDS, Hand, Hands, Neighbours
from mobee.model.engine import Engine as NativeEngine
from mobee.model.pose import Engine, Pose
from mobee.model.world import World, link_pose
from mobee.model.world_object import seen_from, sphere
from mobee.robot.robot import Robot

_FLOAT = np.dtype(np.float64)

Reaching = str | Sequence[str] | None
"""The name of the marker that reaches for the targets, or the names of up to two markers; None: no marker."""


class Model:
    """A robot in a world: evaluates poses, in any number of threads, while other threads edit the world.

    Each evaluation uses one snapshot of the world and never waits for an edit. `world`: the objects around the robot; None: an empty world.
    `engine`: "compiled", the engine in C++, or "fcl", an independent and slow reference. Raises InvalidValue if `robot` or `world` has
    another type, and UnknownName for another engine.
    """

    def __init__(self, robot: Robot, world: World | None = None, engine: Literal["compiled", "fcl"] = "compiled") -> None:
        if not isinstance(robot, Robot):
            raise InvalidValue(f"robot is {robot!r}; it must be a Robot, as load_robot returns it.")
        if not isinstance(world, World | None):
            raise InvalidValue(f"world is {world!r}; it must be a World, as load_world returns it, or None.")
        self.robot = robot
        self.world = World() if world is None else world
        self._engine = _engine(robot, engine)
        self._motors = len(robot.motor_table)
        self._shape = (self._motors,)  # of one pose
        self._hands_of: dict[tuple[str, ...], Hands] = {(): NO_HANDS}  # found so far; the engine compares them by identity
        self._hand_of: dict[str, Hand] = {}

    def __reduce__(self) -> tuple[type[Model], tuple[Robot, World, str]]:
        """Copy or pickle the robot and the world; `copy.copy` makes a model in the same world, `copy.deepcopy` one in a copy of it."""
        return type(self), (self.robot, self.world, "compiled" if isinstance(self._engine, NativeEngine) else "fcl")

    def hands(self, reaching: Reaching) -> Hands:
        """Return a tuple with the hand of each marker that reaches, in the order given: the links whose contacts with targets are ignored.

        `reaching`: name of a marker, names of up to two markers, or None: an empty tuple. Raises UnknownName for an unknown marker, and
        InvalidValue for more than two markers.
        """
        markers = () if reaching is None else (reaching,) if isinstance(reaching, str) else tuple(reaching)
        known = self._hands_of.get(markers)
        if known is None:
            if len(markers) > MAX_HANDS:
                raise InvalidValue(f"{len(markers)} markers reach at once: {', '.join(markers)}; at most {MAX_HANDS} may")
            known = self._hands_of.setdefault(markers, tuple(self.hand(one) for one in markers))
        return known

    def hand(self, marker: str) -> Hand:
        """Return the hand of a marker: the links whose contacts with targets are ignored while the marker reaches; raises UnknownName.

        The hand is the marker's link (the link on which the marker is) and all links that this link carries. The fields (volumes that cause
        repulsive forces) of links nearer to the base, such as the forearm, may be so large that they contain the marker when the robot is
        at home. Of the links of the marker's part whose fields contain it, one is nearest to the base. Contacts of targets with the fields
        of this link, and with the fields of all links that it carries, are ignored too.
        """
        known = self._hand_of.get(marker)
        if known is None:
            known = self._hand_of[marker] = self._find_hand(self.robot.marker(marker).link, marker)
        return known

    def _find_hand(self, link: int, marker: str) -> Hand:
        home = self.robot.home.copy()
        speck = World()
        speck.add("marker", sphere(1e-9), position=Pose(self.robot, self._engine, home, EMPTY, NO_HANDS).position(marker))
        table, _ = self._engine.contacts(home[None], speck.snapshot, NO_HANDS)
        around = set(table.first_link[(table.kind == 1) & (table.second_link < 0)].tolist())
        fields = here = link
        part = self._part_of(link)
        while here > 0 and self._part_of(here) == part:
            fields = here if here in around else fields
            here = self.robot.joints[here - 1].parent
        return Hand(link, fields)

    def _part_of(self, link: int) -> str | None:
        """Return the part of the nearest motor that moves a link; None for the base."""
        while link > 0:
            driven = np.flatnonzero(self.robot.coupling[0][link - 1])
            if driven.size:
                return self.robot.motor_table[int(driven[0])].part
            link = self.robot.joints[link - 1].parent
        return None

    def evaluate(self, q: ArrayLike, threads: int = 1, reaching: Reaching = None) -> Pose:
        """Return the pose of the robot at q in the present world, or a batch of poses; the world is not changed.

        Args:
            q: motor positions, (n,) or (..., n) rad, in the order of robot.motors.
            threads: number of threads; each evaluates a block of a batch, and the results are bit-equal for any number.
            reaching: name of the marker (a named point on a link) that reaches for the targets, or names of up to two markers; contacts of
                their hands (`Model.hand`) with targets are ignored.

        Raises:
            InvalidValue: q has another shape or is not finite.
            UnknownName: the robot does not have the marker.
        """
        one = self._one_pose(q)
        value: Array | bytes = self._checked(q) if one is None else one
        if threads != 1:  # the usual case is not checked
            threads = checked_threads(threads)
        return Pose(self.robot, self._engine, value, self.world.snapshot, NO_HANDS if reaching is None else self.hands(reaching), threads)

    def track(self, skin: float = 0.02) -> Track:
        """Return an evaluator that is faster if each pose is near the previous one, as in a motion; make one for each thread.

        `skin`: m; the evaluator keeps a list of the pairs of volumes that are nearer than this. The engine "fcl" has no such list and
        evaluates every pair. Raises InvalidValue unless the skin is finite and above 0.
        """
        if not (is_number(skin) and 0.0 < skin < math.inf):
            raise InvalidValue(f"skin {skin!r} m: must be a finite distance above 0")
        return Track(self, self._engine, skin)

    def jacobian(self, q: ArrayLike, marker: str) -> Array:
        """Return the Jacobian of a marker in the poses q (..., n) rad, (..., 6, n) in the root frame (thesis eq. 5.1).

        The first three rows are linear [m/rad], the last three angular; there is a column for each motor. Raises UnknownName if the robot
        does not have the marker, and InvalidValue if q has another shape or is not finite.
        """
        value = self._checked(q)
        m = self.robot.marker(marker)
        found = self._engine.jacobians(value.reshape(-1, self._motors), m.link, m.position)
        return found.reshape(*value.shape[:-1], 6, self._motors)

    def attach(self, name: str, link: str, q: ArrayLike) -> None:
        """Attach a world object to a link, so that it moves with the link from now on.

        The object keeps the position and rotation relative to the link that it has while the robot is at q (n,) rad. The pose at q becomes
        the robot's present pose in the world, as if `World.follow` was called with it. Raises UnknownName for an unknown object or link,
        and InvalidValue if q has another length or is not finite.
        """
        pose = self.evaluate(q)
        if pose.q.ndim != 1:
            raise InvalidValue(f"q has shape {pose.q.shape}; an object is attached at one pose, ({self._motors},) rad.")
        carrier = link_pose(pose, link)
        if name not in pose.objects:
            raise UnknownName("world object", name, pose.objects)
        self.world.follow(pose)
        self.world.attach(name, link, seen_from(carrier, pose.objects[name]))

    def _one_pose(self, q: ArrayLike) -> bytes | None:
        """Return the bytes of one pose given as a float64 array, the usual case; None for everything else, whose check takes longer."""
        if type(q) is np.ndarray and q.dtype is _FLOAT and q.shape == self._shape:
            value = q.tobytes()
            signs_and_exponents = value[7::8]  # the highest seven bits of the exponent are set beyond 1e303, and of inf and NaN
            if not (127 in signs_and_exponents or 255 in signs_and_exponents):
                return value
        return None

    def _checked(self, q: ArrayLike) -> Array:
        n = self._motors
        one = self._one_pose(q)
        if one is not None:
            return np.frombuffer(one).copy()
        value = real_array("q", q)
        if value.ndim == 0 or value.shape[-1] != n:
            raise InvalidValue(f"q has shape {value.shape}; {self.robot.name!r} has {n} motors, so it must be ({n},) or (..., {n}) rad.")
        if not np.isfinite(value).all():
            where = np.argwhere(~np.isfinite(value))[0]
            raise InvalidValue(f"q of motor {self.robot.motors[where[-1]]!r} is {value[tuple(where)]}; it must be a finite angle in rad.")
        return value


class Track:
    """Evaluates consecutive poses of one model: faster than `Model.evaluate` if each is near the previous one, with the same results.

    The argument `skin` of `Model.track` is a distance: pairs of volumes that are farther apart are not checked until a volume has moved by
    half this distance. A track takes little time to make and is for one thread at a time. For large steps between poses it is as fast as
    `Model.evaluate`.
    """

    def __init__(self, model: Model, engine: Engine, skin: float) -> None:
        """Make a track; users call `Model.track`.

        `engine`: of the model; the engine of python-fcl has no list of near pairs and evaluates every pair. `skin`: m; pairs of volumes
        nearer than this are in the list.
        """
        self._model = model
        self._neighbours = Neighbours(engine, skin) if isinstance(engine, NativeEngine) else None

    def evaluate(self, q: ArrayLike, reaching: Reaching = None) -> Pose:
        """Return the pose at q (n,) rad, or the poses along a path q (..., n) rad, evaluated in this order.

        `reaching`: name of the marker that reaches for the targets, or names of up to two; None: none. The compiled engine computes the
        contacts at once, not when they are read. Raises InvalidValue if q has another shape or is not finite, and UnknownName if the robot
        does not have the marker.
        """
        pose = self._model.evaluate(q, reaching=reaching)
        if self._neighbours is not None:
            pose.compute_contacts(self._neighbours)
        return pose


def _engine(robot: Robot, name: str) -> Engine:
    if name == "compiled":
        return engine_of(robot)
    if name == "fcl":
        from mobee.model.fcl_engine import FclEngine

        return FclEngine(robot)
    raise UnknownName("engine", name, ("compiled", "fcl"))


def engine_of(robot: Robot) -> NativeEngine:
    """Return a new compiled engine for a robot; the first call in a process loads the compiled core."""
    return NativeEngine(robot)
