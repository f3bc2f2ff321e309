# SPDX-License-Identifier: Apache-2.0
"""A grasp from the side with one hand: the pose of the palm, postures with this pose, and the closing of the fingers (thesis 4.3.3).

The palm is beside an upright thing. `Hand` opens the fingers, closes them, and closes them until they touch something (thesis 9.4.2).
Motors of the fingers are those that move only links beyond the palm. One motor may drive several joints, as the robot's file says.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints
from mobee.control.controller import Controller
from mobee.control.gains import Gains
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms, tables
from mobee.model.model import Model
from mobee.roadmap.ik import costs
from mobee.roadmap.ik.problem import chosen
from mobee.roadmap.ik.solve import solve_ik
from mobee.roadmap.playback import attractor_for
from mobee.robot.motor_units import limit_zones, motor_units
from mobee.robot.robot import Robot

UP = np.array([0.0, 0.0, 1.0])
AHEAD = 0.04  # m in front of the palm: the place about which fingers close
WORLD = -1  # link of a world object in a contact
STEPS = 60  # from open to closed, in which contacts are looked for


@dataclass(frozen=True, slots=True)
class Grip:
    """The pose of a palm when its hand closes around an upright thing, and how it closes; the defaults are for the iCub.

    The numbers were found by simulation in MuJoCo. The axes of a palm are x along its fingers, -y to its thumb, z its normal.

    Attributes:
        along: distance from the palm's marker to the thing's axis, along the fingers [m].
        gap: distance between palm and thing when the hand closes [m].
        before: distance between palm and thing at the pre-grasp, the pose before the hand moves to the thing [m].
        height: height of the palm above the ground on which the thing stands [m]. At this height the ground does not touch the fields
            (volumes that cause repulsive forces) of hand and forearm.
        oppose: rad, opposition of the thumb.
        spread: rad, spread of the fingers.
        fingers: share by which the fingers close, 0 open to 1 closed.
        thumb: share by which the thumb closes.
        squeeze: rad, how far the goals of the fingers are beyond the positions at which the thing stopped them.
    """

    along: float = 0.047
    gap: float = 0.009
    before: float = 0.05
    height: float = 0.105
    oppose: float = float(np.deg2rad(85.0))
    spread: float = float(np.deg2rad(10.0))
    fingers: float = 0.5
    thumb: float = 0.8
    squeeze: float = 0.08


@dataclass(frozen=True, slots=True, eq=False)
class Palm:
    """A pose of a palm in the root frame.

    `position`: (3,) m. `rotation`: (3, 3), whose columns are unit vectors: the direction along the fingers, the direction away from the
    thumb, and the normal of the palm.
    """

    position: Array
    rotation: Array


def palm_beside(place: ArrayLike, radius: float, azimuth: float, gap: float, ground: float, grip: Grip) -> Palm:
    """Return the pose of the palm beside an upright thing, with the thumb up.

    Args:
        place: (2,) m, x and y of the thing's axis, root frame.
        radius: radius of the thing [m].
        azimuth: direction that the palm faces, rad; 0: the left (-y), pi / 2: the front (-x).
        gap: between palm and thing [m].
        ground: height of the surface on which the thing stands [m].
        grip: distances of the palm from the thing and from the ground.
    """
    x, y = np.asarray(place, dtype=np.float64)
    normal = np.array([-np.sin(azimuth), -np.cos(azimuth), 0.0])
    fingers = np.cross(-UP, normal)
    centre = np.array([x, y, ground + grip.height])
    return Palm(centre - (radius + gap) * normal - grip.along * fingers, np.column_stack([fingers, -UP, normal]))


class SideGrasp:
    """Palm poses and postures for grasps from the side with one hand.

    Args:
        model: the robot in a world with the objects that it must not touch.
        marker: name of the palm's marker.
        motors: names of parts and of single motors that may move, without the motors of the fingers.
        starts: (S, n) rad, postures from which inverse kinematics starts, and near which its results stay.
        pushing: the robot in another world, from whose objects the control law's repulsive forces are computed; None: `model`.
    """

    def __init__(self, model: Model, marker: str, motors: Sequence[str], starts: ArrayLike, pushing: Model | None = None) -> None:
        self.model, self.marker, self.motors, self.grip = model, marker, tuple(motors), Grip()
        self.hand, self.gains = Hand(model.robot, marker), Gains.default()
        self._moved = chosen(model.robot, motors)
        self._narrow = Model(_narrowed(model.robot, self._moved, self.gains), model.world)
        self._pushing = model if pushing is None else pushing
        self._controller = Controller(self._pushing, self.gains)
        names = [model.robot.motors[index] for index in self.hand.motors]
        self._thumb, self._oppose, self._spread = (
            self.hand.motors[[word in name for name in names]] for word in ("thumb", "thumb_oppose", "hand_finger")
        )
        self.starts = np.array([self.opened(start) for start in np.atleast_2d(np.asarray(starts, dtype=np.float64))])

    def opened(self, q: Array) -> Array:
        """Return a copy of q (n,) rad with the hand open and the thumb opposed, so that a thing fits between thumb and fingers."""
        return self._closed(q, 0.0, 0.0)

    def closed(self, q: Array) -> Array:
        """Return a copy of q (n,) rad with fingers and thumb closed; a thing in the hand stops them before they reach these positions."""
        return self._closed(q, self.grip.fingers, self.grip.thumb)

    def squeezed(self, q: Array) -> Array:
        """Return the goals (m,) rad of the finger motors with which the hand holds a thing.

        They are a little more closed (`Grip.squeeze`) than at q (n,) rad, the posture in which the thing stopped the fingers. With farther
        goals, strong fingers would slowly push the thing out of the hand.
        """
        fingers = q[self.hand.motors]
        toward = np.clip(self.closed(q)[self.hand.motors] - fingers, -self.grip.squeeze, self.grip.squeeze)
        held: Array = fingers + toward
        return held

    def posture(self, palm: Palm, starts: Array | None = None) -> Array | None:
        """Return a posture (n,) rad without contacts of solids in which the palm has this pose; None if none is found.

        Among the results of inverse kinematics it is the one with the smallest repulsive forces of the control law (`push`). `starts`:
        (S, n) rad, postures from which inverse kinematics starts; None: the `starts` of this object.
        """
        found: list[tuple[float, Array]] = []
        for start in self.starts if starts is None else starts:
            within = np.clip(start, *self._narrow.robot.limits.T)
            terms = [costs.position(self.marker, palm.position), costs.orientation(self.marker, palm.rotation), costs.constraints()]
            solution = solve_ik(
                self._narrow,
                costs=[*terms, costs.collision(), costs.home(within)],
                start=within,
                motors=self.motors,
                method="least_squares",
            )
            if solution.reached:
                found.append((self.push(solution.q), solution.q))
        return min(found, key=lambda one: one[0])[1] if found else None

    def push(self, q: Array) -> float:
        """Return the largest absolute value, over all motors, of the control law's forces at q (n,) rad, in rad/s^2.

        They are the forces without spring and damping, as `forces` returns them.
        """
        return float(np.abs(self.forces(q)).max())

    def forces(self, q: Array) -> Array:
        """Return the control law's forces at q (n,) rad, without spring and damping, (n,) rad/s^2.

        They are 0 for motors that the grasp does not move. Targets do not repel the hand on which the palm's marker is.
        """
        found = np.zeros(len(q))
        found[self._moved] = self._controller.forces(self._pushing.evaluate(q, reaching=self.marker)).total[self._moved]
        return found

    def attractor(self, q: Array) -> Array:
        """Return the attractor (n,) rad (the goal of the control law's spring) with which the robot rests at q (n,) rad.

        At q, the spring force towards this attractor cancels the forces that `forces` returns. A force above 0.8 of the largest spring
        force is cancelled only in part, and the attractor stays within the motors' limits.
        """
        return attractor_for(self.model.robot, self.gains, q, -self.forces(q))

    def _closed(self, q: Array, fingers: float, thumb: float) -> Array:
        found = self.hand.posture(q, fingers)
        found[self._thumb] = self.hand.posture(q, thumb)[self._thumb]
        found[self._oppose], found[self._spread] = self.grip.oppose, self.grip.spread
        return found


class Hand:
    """The finger motors of one hand.

    `motors`: (m,) indices, ascending. `open`, `closed`: (m,) rad, the ends of these motors' ranges at which the hand is open and closed.
    """

    def __init__(self, robot: Robot, marker: str) -> None:
        """Find the finger motors of a hand; `marker`: name of the palm's marker, whose normal points out of the palm, as "left_palm".

        Raises InvalidValue if no motor moves only links beyond the palm, and UnknownName if the robot has no such marker.
        """
        self.robot, palm = robot, robot.marker(marker)
        ancestry, matrix = tables(robot).ancestry, robot.coupling[0]
        self._links = [link for link in range(len(robot.links)) if link != palm.link and set(ancestry[palm.link]) < set(ancestry[link])]
        self._solids = [shape for shape in robot.shapes if shape.link in self._links]
        carrying = sorted({int(j) for shape in self._solids for j in ancestry[shape.link]} - {int(j) for j in ancestry[palm.link]})
        others = np.setdiff1d(np.arange(len(robot.joints)), [link - 1 for link in self._links])
        self.motors: Ints = np.flatnonzero((matrix[carrying] != 0.0).any(axis=0) & ~(matrix[others] != 0.0).any(axis=0))
        """Indices of the fingers' motors, ascending, (m,)."""
        if not len(self.motors):
            raise InvalidValue(f"{marker} of {robot.name!r} has no fingers: no motor moves links beyond {robot.links[palm.link]} alone")
        centre = palm.position + AHEAD * palm.normal
        low, high = robot.limits[self.motors].T
        ends = zip(self.motors.tolist(), low, high, strict=True)
        closes_high = np.array([self._distance(m, b, palm.link, centre) < self._distance(m, a, palm.link, centre) for m, a, b in ends])
        self.open, self.closed = np.where(closes_high, low, high), np.where(closes_high, high, low)

    def posture(self, q: Array, share: float) -> Array:
        """Return a copy of q (n,) rad with the fingers closed by `share`, from 0 (open) to 1 (closed).

        Raises InvalidValue for a share outside this range.
        """
        if not 0.0 <= share <= 1.0:
            raise InvalidValue(f"share {share:g} of closing: must be between 0, open, and 1, closed")
        found = q.copy()
        found[self.motors] = self.open + share * (self.closed - self.open)
        return found

    def closed_around(self, model: Model, q: Array) -> tuple[Array, tuple[str, ...]]:
        """Return a copy of q (n,) rad with the fingers closed until they touch objects of the model's world, and these objects' names.

        The computation begins with open fingers and closes all of them together; a motor stops as soon as a solid that it moves touches an
        object, or at the end of its range.
        """
        found, moving, touched = self.posture(q, 0.0), np.ones(len(self.motors), dtype=bool), dict[str, None]()
        moves = (self.robot.coupling[0][:, self.motors] != 0.0).T
        for step in range(1, STEPS + 1):
            found[self.motors[moving]] = (self.open + step / STEPS * (self.closed - self.open))[moving]
            for contact in model.evaluate(found).contacts:
                if contact.kind == "solid" and contact.first_link in self._links and contact.second_link == WORLD:
                    moving &= ~moves[:, tables(self.robot).ancestry[contact.first_link]].any(axis=1)
                    touched[contact.second] = None
            if not moving.any():
                break
        return found, tuple(touched)

    def _distance(self, motor: int, value: float, palm: int, centre: Array) -> float:
        """Return the mean distance of the fingers' solids from a place in front of the palm, one motor at `value`, the others at home."""
        q = self.robot.home.copy()
        q[motor] = value
        transforms = link_transforms(self.robot, q)
        moved = transforms[palm, :3, :3] @ centre + transforms[palm, :3, 3]
        places = [transforms[one.link, :3, :3] @ one.position + transforms[one.link, :3, 3] for one in self._solids]
        return float(np.linalg.norm(np.array(places) - moved, axis=1).mean())


def _narrowed(robot: Robot, columns: Ints, gains: Gains) -> Robot:
    """Return the robot without the zones, in which the law pushes, before the limits of some motors and before the clauses' bounds."""
    zones = limit_zones(robot, gains.of_robot("limit_width", robot))
    table = list(robot.motor_table)
    for index in columns.tolist():
        low, high = robot.limits[index] + zones[index] * np.array([1.0, -1.0])
        table[index] = replace(table[index], limits=(low, high), home=float(np.clip(table[index].home, low, high)))
    units = motor_units(robot)
    clauses = [replace(one, b=one.b - gains.constraint_width * np.linalg.norm(one.a * units, axis=1)) for one in robot.clauses]
    return replace(robot, motor_table=tuple(table), clauses=tuple(clauses))
