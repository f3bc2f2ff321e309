# SPDX-License-Identifier: Apache-2.0
"""The fingers of a hand: open, closed, and closed until they touch something (thesis 9.4.2).

Motors of the fingers are those that move only links beyond the palm. One motor may drive several joints, as the robot's file says.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms, tables
from mobee.model.model import Model
from mobee.robot.robot import Robot

AHEAD = 0.04  # m in front of the palm: the place about which fingers close
WORLD = -1  # link of a world object in a contact
STEPS = 60  # from open to closed, in which contacts are looked for


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
