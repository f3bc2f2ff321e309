# SPDX-License-Identifier: Apache-2.0
"""A lattice: samples at every combination of levels of some joints of one part (thesis 6.2, 7.1-7.4)."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, checked_seed, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.neighbours import equidistant_goals, lattice_digits, lattice_strides, nearest_goals
from mobee.learning.object_space import ObjectSpace
from mobee.learning.space import MAX_STATES, Space, checked_joints, checked_neighbours
from mobee.robot.robot import Robot

Levels = Sequence[float] | Sequence[Sequence[float]] | Mapping[str, Sequence[float]]


class Lattice(Space):
    """A space whose samples are at every combination of some levels of each joint; actions aim at the samples of neighbours.

    A state is the Voronoi cell of its sample. The numbers of the states are as published: state = d0 + L0 d1 + L0 L1 d2 + ..., where d is
    the index of a joint's level and L its number of levels; so the first joint changes fastest. An action is the index of its goal among
    the state's goals in ascending order.

    Args:
        robot: the robot; levels are fractions between its motor limits.
        joints: motor names, all of one part.
        levels: fractions of each joint's range, ascending in [0, 1]: one sequence for all joints, one for each joint in their order, or a
            dict from each joint's name to its sequence.
        neighbours: number of nearest samples (distances in fractions of the ranges) to which each state has actions; "equidistant": the
            samples one level away along one joint; None: 16, or all others if there are fewer.
        tie_seed: if several samples are equally near, but not all of them become neighbours, a random choice with this seed decides.
        rest: fraction of its range at which each other motor of the part stays; or a list with one fraction for each motor of the part.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[str],
        levels: Levels = (0.25, 0.5, 0.75),
        neighbours: int | Literal["equidistant"] | None = None,
        tie_seed: int = 0,
        rest: float | Sequence[float] = 0.5,
    ) -> None:
        _, indices = checked_joints(robot, joints)
        self.tie_seed = checked_seed(tie_seed)
        self.levels = _checked_levels(levels, joints)
        """The levels of each joint, as fractions of its range."""
        sizes = tuple(len(one) for one in self.levels)
        digits = lattice_digits(sizes)
        fractions = np.stack([np.array(one)[column] for one, column in zip(self.levels, digits.T, strict=True)], axis=1)
        if neighbours == "equidistant":
            self.neighbours: int | Literal["equidistant"] = neighbours
            goals = equidistant_goals(digits, sizes)
        else:
            self.neighbours = checked_neighbours(neighbours, len(digits), also=', or "equidistant"')
            goals = nearest_goals(fractions, self.neighbours, self.tie_seed)
        low, high = robot.limits[indices].T
        super().__init__(robot, joints, low + fractions * (high - low), goals, rest)
        self._strides: list[int] = lattice_strides(sizes).tolist()
        self._borders = [_borders(one, *limits) for one, limits in zip(self.levels, robot.limits[indices], strict=True)]

    def __repr__(self) -> str:
        kind = "equidistant" if self.neighbours == "equidistant" else f"{self.neighbours} nearest"
        return f"<Lattice of {self.part}: {len(self)} states, {self.state_actions} state-actions ({kind})>"

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments and a hash of the space, as JSON values.

        `mobee.learning.record.space_from` rebuilds the space from them.
        """
        first = self.levels[0]
        levels = list(first) if set(self.levels) == {first} else [list(one) for one in self.levels]
        return self._made | {"levels": levels, "neighbours": self.neighbours, "tie_seed": self.tie_seed}

    def _cell(self, q: list[float]) -> int:
        state = 0
        for stride, borders, x in zip(self._strides, self._borders, q, strict=True):  # cells are boxes
            state += stride * bisect_left(borders, x)
        return state


def _borders(levels: Sequence[float], low: float, high: float) -> list[float]:
    """Return the midpoints between the levels of a joint, in [rad]."""
    return [float(low + (one + next_) / 2 * (high - low)) for one, next_ in pairwise(levels)]


def _checked_levels(levels: Levels, joints: Sequence[str]) -> tuple[tuple[float, ...], ...]:
    """Return the levels of each joint, in the order of the joints; raises InvalidValue, UnknownName."""
    if isinstance(levels, Mapping):
        for name in levels:
            if name not in joints:
                raise UnknownName("joint of the levels", name, joints)
        absent = [name for name in joints if name not in levels]
        if absent:
            raise InvalidValue(f"levels of {', '.join(absent)} are missing: give those too, or one sequence for all joints.")
        each: Sequence[ArrayLike] = [levels[name] for name in joints]
    elif any(np.ndim(one) for one in levels):
        each = list(levels)
    else:
        each = [levels] * len(joints)
    if len(each) != len(joints):
        raise InvalidValue(f"levels of {len(each)} joints given: give one sequence for all, or one for each of {', '.join(joints)}.")
    checked = tuple(_checked_fractions(one) for one in each)
    states = int(np.prod([float(len(one)) for one in checked]))
    if states > MAX_STATES:
        raise InvalidValue(
            f"{' x '.join(str(len(one)) for one in checked)} levels make {states} states; the limit is {MAX_STATES}. "
            "Take fewer joints, or several agents with one part each."
        )
    return checked


def _checked_fractions(levels: ArrayLike) -> tuple[float, ...]:
    given = real_array("levels", levels)
    valid = given.ndim == 1 and len(given) >= 2 and (np.diff(given) > 0).all() and given[0] >= 0 and given[-1] <= 1
    if not valid:
        raise InvalidValue(f"levels={levels!r}: give at least two ascending fractions of the joint range in [0, 1], e.g. (.25, .5, .75).")
    return tuple(given.tolist())


BLOCK_GAP = 0.8  # between the blocks of a drawn lattice, in steps of its first joints


def plane_layout(space: Space) -> Array:
    """Compute positions in a plane at which to draw the states, shape (S, 2).

    A lattice becomes a grid of blocks, as in figure 7 of the article in Frontiers in Neurorobotics 7:25 (2014): within a block the first
    joint increases to the right and the second upwards; the third joint chooses the column of the block, the fourth its row, and so on. A
    state of an `ObjectSpace` is a posture and a cell of a grid in which an object can be: each cell of the grid becomes a block, which
    contains all postures. In any other space the samples (one posture for each state) are projected to their two principal components.
    """
    if isinstance(space, Lattice):
        return _nested([len(levels) for levels in space.levels])
    if isinstance(space, ObjectSpace):
        block, columns = plane_layout(space.postures), space.grid.shape[0]
        places = np.stack([space.cells % columns, space.cells // columns], axis=1)
        in_blocks: Array = np.tile(block, (len(space.grid), 1)) + places * (np.ptp(block, axis=0) + 1.0 + BLOCK_GAP)
        return in_blocks
    centred = (space.samples - space.samples.mean(axis=0)) / np.maximum(np.ptp(space.samples, axis=0), 1e-12)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    drawn = centred @ axes[:2].T
    plane: Array = np.pad(drawn, ((0, 0), (0, 2 - drawn.shape[1]))) * np.sqrt(len(space))
    return plane


def _nested(sizes: list[int]) -> Array:
    digits = lattice_digits(sizes)
    drawn, steps = np.zeros((len(digits), 2)), [1.0, 1.0]
    for joint, size in enumerate(sizes):
        axis = joint % 2
        drawn[:, axis] += steps[axis] * digits[:, joint]
        steps[axis] *= size if len(sizes) <= joint + 2 else size + BLOCK_GAP
    return drawn
