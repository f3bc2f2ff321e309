# SPDX-License-Identifier: Apache-2.0
"""Lessons of a robot that learns to see: its observations of a ball, with the positions that the teacher has reported."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array, Ints
from mobee.robot.robot import Robot
from mobee.vision.encoders import Moment

PARTS = ("torso", "head")
"""Names of the parts that move the cameras; their encoders are inputs of a localiser."""


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """An observation of a ball in the pictures of both cameras of the learner, with the position that the teacher reports.

    The teacher is a robot that carries the ball; the learner is a robot that learns to locate it.

    `pixels`: (2, 2) px, column and row of the ball in the left picture, then in the right one. `moment`: the learner's encoders at the
    time stamp of the pictures. `reported`: (3,) m, root frame, position of the ball that the teacher reports. `true`: its true position.
    `pose`: index of the teacher's pose.
    """

    pixels: Array
    moment: Moment
    reported: Array
    true: Array
    pose: int


@dataclass(frozen=True, slots=True, eq=False)
class Lessons:
    """N lessons (`Lesson`) as arrays.

    `inputs`: (N, d), column and row of the ball in the left picture, then in the right one [px], then the encoders of torso and head [rad].
    `reported`: (N, 3) m, root frame, positions of the ball that the teacher, the robot that carries it, reports. `true`: its true
    positions. `poses`: (N,), index of the teacher's pose.
    """

    inputs: Array
    reported: Array
    true: Array
    poses: Ints

    @classmethod
    def of(cls, robot: Robot, lessons: list[Lesson]) -> Lessons:
        """Convert a list of lessons to arrays."""
        seeing = seeing_motors(robot)
        rows = [np.concatenate([one.pixels.ravel(), one.moment.q[seeing]]) for one in lessons]
        reported, true = (np.array([getattr(one, name) for one in lessons]) for name in ("reported", "true"))
        return cls(np.array(rows), reported, true, np.array([one.pose for one in lessons], dtype=np.intp))

    def __len__(self) -> int:
        return len(self.inputs)

    def __getitem__(self, rows: Ints | slice) -> Lessons:
        return Lessons(self.inputs[rows], self.reported[rows], self.true[rows], self.poses[rows])


def seeing_motors(robot: Robot) -> Ints:
    """Return the indices of the motors of torso and head, which move the cameras, in this order."""
    found: Ints = np.concatenate([np.arange(len(robot.motors))[robot.part(part).slice] for part in PARTS])
    return found


def split_by_pose(poses: Ints, held_out: float, seed: int) -> tuple[Ints, Ints]:
    """Split rows of lessons; return the indices of the rows to learn from, and those of the rows to test with.

    `poses`: (N,) index of the teacher's pose in each row; the teacher is the robot that shows the ball. All rows of a pose belong to the
    same set. `held_out`: share of the poses whose rows are for tests, 0 to 1; at least one pose is for tests. In the rows to learn from,
    the rows of each pose are together, and the poses are in random order. So one can learn from few poses by taking only the first rows.
    `seed`: seed of the random order.
    """
    each = np.random.default_rng([seed, 0x73706C69]).permutation(np.unique(poses))
    kept = len(each) - max(1, round(held_out * len(each)))
    learned: Ints = np.concatenate([np.flatnonzero(poses == pose) for pose in each[:kept]])
    return learned, np.flatnonzero(np.isin(poses, each[kept:]))
