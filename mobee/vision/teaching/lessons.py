# SPDX-License-Identifier: Apache-2.0
"""What a robot that learns to see has seen, with the places that its teacher has reported."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array, Ints
from mobee.robot.robot import Robot
from mobee.vision.encoders import Moment

PARTS = ("torso", "head")
"""The parts whose encoders are inputs: those that move the cameras."""


@dataclass(frozen=True, slots=True, eq=False)
class Lesson:
    """The ball in both pictures of one moment: pixels (2, 2), the encoders, where the teacher reports it, and where it is, (3,) m.

    `pose`: the number of the teacher's pose.
    """

    pixels: Array
    moment: Moment
    reported: Array
    true: Array
    pose: int


@dataclass(frozen=True, slots=True, eq=False)
class Lessons:
    """The lessons as arrays.

    `inputs` (N, d): columns and rows of the ball in the left and right picture [px], then encoders [rad]; `reported` (N, 3) and `true`
    (N, 3) m, root frame; `poses` (N,): of the teacher.
    """

    inputs: Array
    reported: Array
    true: Array
    poses: Ints

    @classmethod
    def of(cls, robot: Robot, lessons: list[Lesson]) -> Lessons:
        """Stack lessons; the encoders are those of PARTS."""
        seeing = seeing_motors(robot)
        rows = [np.concatenate([one.pixels.ravel(), one.moment.q[seeing]]) for one in lessons]
        reported, true = (np.array([getattr(one, name) for one in lessons]) for name in ("reported", "true"))
        return cls(np.array(rows), reported, true, np.array([one.pose for one in lessons], dtype=np.intp))

    def __len__(self) -> int:
        return len(self.inputs)

    def __getitem__(self, rows: Ints | slice) -> Lessons:
        return Lessons(self.inputs[rows], self.reported[rows], self.true[rows], self.poses[rows])


def seeing_motors(robot: Robot) -> Ints:
    """Return the motors of PARTS, in their order."""
    found: Ints = np.concatenate([np.arange(len(robot.motors))[robot.part(part).slice] for part in PARTS])
    return found


def split_by_pose(poses: Ints, held_out: float, seed: int) -> tuple[Ints, Ints]:
    """Return the rows to learn from, and the rows of a share `held_out` of the teacher's poses, which are never learned from.

    The rows to learn from are in the order of shuffled poses, so that the first ones are of few poses as well.
    """
    each = np.random.default_rng([seed, 0x73706C69]).permutation(np.unique(poses))
    kept = len(each) - max(1, round(held_out * len(each)))
    learned: Ints = np.concatenate([np.flatnonzero(poses == pose) for pose in each[:kept]])
    return learned, np.flatnonzero(np.isin(poses, each[kept:]))
