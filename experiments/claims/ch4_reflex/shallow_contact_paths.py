# SPDX-License-Identifier: Apache-2.0
"""Straight paths of the hand into the table's field at any angle, and a client that sends position references along such a path.

The table's field is the zone around the table in which the hand's fields (larger volumes around its links, which are not solid but cause
repulsive forces) overlap the table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np

from mobee.arrays import Array
from mobee.control.reflex import Violation, Watch
from mobee.model.kinematics import quaternion_from_matrix
from mobee.model.model import Model
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot

SPEED = 0.2  # of the motors' top speed, as in the thesis
MARKER = "left_palm"
MOTORS = ("torso_*", "l_shoulder_*", "l_elbow", "l_wrist_*")  # name patterns of the motors that move the hand
HAND = ("l_hand", "l_palm", "l_fingers", "l_thumb")  # prefixes of the names of its shapes
ASIDE = {"r_shoulder_roll": 70.0, "r_elbow": 90.0}  # degrees, so that the other hand is far from the paths
BEFORE, BEHIND, LIFT = 0.06, 0.04, 0.04  # m, length of the path before and behind the first contact, and height above its start
TOP = 0.1  # m below the root, the table's top
STEP = 0.002  # m between two postures of a path
SAMPLED = (0.3, 0.7)  # shares of the motors' ranges within which postures are drawn
TORSO = np.deg2rad([[0.0, 0.0], [0.0, 0.0], [0.0, 25.0]])  # rad, ranges of yaw, roll and pitch of drawn postures
PRECISE, DAMPING = 2e-4, 1e-5  # of the inverse kinematics: m and rad; m^2
MARGIN = 2.0  # degrees within the motors' limits, so that noise does not matter there
HIGHEST_START = 0.15  # m, of the palm


@dataclass(frozen=True, slots=True, eq=False)
class Spot:
    """A place at which the left hand just touches the table's field, and the horizontal direction of the paths through this place.

    The table's field is the zone around the table in which the hand's fields (larger volumes around its links, which are not solid but
    cause repulsive forces) overlap the table.  `q`: posture there, (n,) rad.  `position` (3,) m and `rotation` (3, 3): pose of the palm,
    root frame.  `heading`: horizontal unit vector (3,), root frame.
    """

    q: Array
    position: Array
    rotation: Array
    heading: Array


@dataclass(frozen=True, slots=True, eq=False)
class HandPath:
    """A path of the hand that begins above the table, and then approaches straight, at a constant angle, into the table's field.

    The table's field is the zone around the table in which the hand's fields (larger volumes around its links, which are not solid but
    cause repulsive forces) overlap the table.  `postures`: (w, n) rad, in the order of the path.  `start`: index of the posture at which
    the straight approach begins.
    """

    postures: Array
    start: int


class Table:
    """The iCub at its table, and straight paths of its left hand into the table's field.

    The table's field is the zone around the table in which the hand's fields (larger volumes around its links, which are not solid but
    cause repulsive forces) overlap the table.  `robot`, `model`: the iCub and its model at the table.  `watch`: checks poses for contacts
    and for motors beyond limits and constraints.
    """

    def __init__(self) -> None:
        self.robot: Robot = load_robot("icub")
        world = load_world("table")
        for name, item in list(world.objects.items()):
            if item.role == "target":
                world.remove(name)
        self.model = Model(self.robot, world)
        self.watch = Watch(self.robot)
        names = self.robot.motors
        self._moving = np.array([i for i, name in enumerate(names) if any(fnmatchcase(name, pattern) for pattern in MOTORS)])
        margin = np.deg2rad([MARGIN, -MARGIN])
        self._limits = self.robot.limits[self._moving] + margin
        self._home = self.robot.home.copy()
        for name, degrees in ASIDE.items():
            self._home[self.robot.motor_index(name)] = np.deg2rad(degrees)

    def spots(self, number: int, seed: int) -> list[Spot]:
        """Return `number` random places at which the hand just touches the table's field, as `Spot`.

        The table's field is the zone around the table in which the hand's fields (larger volumes around its links, which are not solid but
        cause repulsive forces) overlap the table.  The arm can follow the paths through each place at 90, 45 and 0 degrees to the table's
        top.  `seed`: of the random choice.
        """
        rng = np.random.default_rng([seed, 0x67])
        found: list[Spot] = []
        while len(found) < number:
            spot = self._touch(rng)
            if spot is not None and all(self.path(spot, np.deg2rad(angle)) is not None for angle in (90.0, 45.0, 0.0)):
                found.append(spot)
        return found

    def _touch(self, rng: np.random.Generator) -> Spot | None:
        """Lower the hand from a random posture until it, and nothing else, touches the table; None if that fails."""
        q = self._home.copy()
        low, high = self._limits.T
        q[self._moving] = low + rng.uniform(*SAMPLED, len(low)) * (high - low)
        q[: len(TORSO)] = rng.uniform(*TORSO.T)
        heading = rng.uniform(0.0, 2.0 * np.pi)
        pose = self.model.evaluate(q)
        position, rotation = pose.position(MARKER), pose.rotation(MARKER)
        if self.watch.check(pose) or position[2] > HIGHEST_START:
            return None
        for _ in range(round((HIGHEST_START + TOP) / STEP)):
            position = position - np.array([0.0, 0.0, STEP])
            moved = self._solve(q, position, rotation)
            if moved is None:
                return None
            q = moved
            found = self.watch.check(self.model.evaluate(q))
            if found:
                return self._edge(q, position, rotation, heading) if _is_on_table(found, HAND) else None
        return None

    def _edge(self, touching: Array, position: Array, rotation: Array, heading: float) -> Spot | None:
        """Return the spot at which the contact begins, by bisection of the height of the hand.

        `touching`: posture (n,) rad in which the hand touches the table; one step higher (STEP) it did not.  `position` (3,) m and
        `rotation` (3, 3): pose of the hand in this posture, root frame.  `heading`: horizontal direction of the paths through the spot,
        angle [rad] from the x axis.  Returns None if the arm cannot reach one of the heights with this rotation.
        """
        low, high, q = position[2], position[2] + STEP, touching
        for _ in range(8):
            middle = np.array([*position[:2], 0.5 * (low + high)])
            solved = self._solve(q, middle, rotation)
            if solved is None:
                return None
            q = solved
            low, high = (middle[2], high) if self.watch.check(self.model.evaluate(q)) else (low, middle[2])
        direction = np.array([np.cos(heading), np.sin(heading), 0.0])
        return Spot(q, np.array([*position[:2], high]), rotation, direction)

    def path(self, spot: Spot, angle: float) -> HandPath | None:
        """Return the path through the spot at an angle [rad] to the table's top; None if the arm cannot follow this path."""
        direction = np.cos(angle) * spot.heading - np.array([0.0, 0.0, np.sin(angle)])
        into = self._line(spot.q, spot, [spot.position + s * direction for s in np.arange(STEP, BEHIND + 1e-9, STEP)])
        back = self._line(spot.q, spot, [spot.position - s * direction for s in np.arange(STEP, BEFORE + 1e-9, STEP)])
        if into is None or back is None:
            return None
        above = spot.position - BEFORE * direction
        up = self._line(back[-1], spot, [above + np.array([0.0, 0.0, z]) for z in np.arange(STEP, LIFT + 1e-9, STEP)])
        if up is None or self.watch.check(self.model.evaluate(up[-1])):
            return None
        postures = np.array([*reversed(up), *reversed(back), spot.q, *into])
        return HandPath(postures, len(up))

    def _line(self, q: Array, spot: Spot, positions: list[Array]) -> list[Array] | None:
        """Return for each of the positions, (3,) m, root frame, a posture (n,) rad with the palm there, oriented as at the spot.

        `q`: a posture near the first of them; each search starts at the posture before.  Returns None if a posture is not found, or has a
        violation other than contacts of the left arm with the table.
        """
        found = []
        for position in positions:
            solved = self._solve(q, position, spot.rotation)
            if solved is None:
                return None
            pose = self.model.evaluate(solved)
            if not _is_on_table(self.watch.check(pose), ("l_",)):
                return None
            q = solved
            found.append(q)
        return found

    def _solve(self, q: Array, position: Array, rotation: Array) -> Array | None:
        """Return the posture near q with this pose of the palm, by damped least squares; None if it is not found."""
        q = q.copy()
        for _ in range(30):
            pose = self.model.evaluate(q)
            turn = quaternion_from_matrix(rotation @ pose.rotation(MARKER).T)
            error = np.concatenate([position - pose.position(MARKER), 2.0 * np.sign(turn[0]) * turn[1:]])
            if np.abs(error).max() < PRECISE:
                return q
            jacobian = self.model.jacobian(q, MARKER)[:, self._moving]
            change = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + DAMPING * np.eye(6), error)
            q[self._moving] = (q[self._moving] + change).clip(*self._limits.T)
        return None


def _is_on_table(violations: Sequence[Violation], touching: tuple[str, ...]) -> bool:
    """Return whether every violation is a contact between the table and a robot shape whose name begins with a prefix in `touching`."""
    return all(v.kind == "contact" and v.what.endswith(" - table") and v.what.startswith(touching) for v in violations)


class Client:
    """A client that sends position references along a path, one per tick.

    The reflex takes control from the client after a contact, and moves the robot back along its recent poses.  When it returns control to
    the client, `retry` selects the reference at which the client continues.

    `begin`: index of the reference at which the straight approach begins.  `runs`: how often the client has begun the straight approach.
    """

    def __init__(self, robot: Robot, path: HandPath, dt: float) -> None:
        fastest = SPEED * np.array([motor.max_velocity for motor in robot.motor_table])
        steps = np.abs(np.diff(path.postures, axis=0)) / fastest  # s, the slowest motor of each step sets the pace
        times = np.concatenate([[0.0], np.cumsum(steps.max(axis=1))])
        self._ticks = np.arange(0.0, times[-1], dt)
        self._references = np.array([np.interp(self._ticks, times, column) for column in path.postures.T]).T
        self.begin = int(np.searchsorted(self._ticks, times[path.start]))  # index of the reference at the start
        self._next = 0
        self.runs = 0  # number of departures from the start

    @property
    def start(self) -> Array:
        """The first posture of the path, above the table, in which the robot begins, (n,) rad."""
        start: Array = self._references[0]
        return start

    @property
    def leaves_start(self) -> bool:
        """Whether the next reference is the first one of the straight approach; the client begins a new position command there."""
        return self._next == self.begin

    @property
    def is_over(self) -> bool:
        """Whether the last reference of the path was sent."""
        return self._next >= len(self._references)

    def next(self) -> Array:
        """Return the next reference (n,) rad; after the end of the path, the last one again."""
        self.runs += self.leaves_start
        reference: Array = self._references[min(self._next, len(self._references) - 1)]
        self._next += 1
        return reference

    def retry(self, q: Array) -> None:
        """Continue at the first reference of the path or of the straight approach, whichever is nearer to the positions `q` (n,) rad."""
        places = (0, self.begin)
        self._next = min(places, key=lambda place: float(np.abs(self._references[place] - q).max()))
