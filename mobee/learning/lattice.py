"""The state-action space: a lattice of samples over some joints of one part (thesis 6.2, 6.3)."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.learning.neighbours import NO_ACTION, equidistant_goals, lattice_digits, nearest_goals
from mobee.robot.robot import Array, Ints, Part, Robot

MAX_STATES = 100_000  # beyond this the space is no learning problem on a robot any more (thesis 7.4)
NEIGHBOURS = 16  # of the thesis' arms


class Lattice:
    """States are the Voronoi cells of samples at every combination of levels; actions go to neighbours' samples.

    Numbering as published: state = d0 + L d1 + L^2 d2 + ..., so the first joint is the fastest; an action is the
    index of its goal among the state's goals in ascending order.

    Args:
        robot: whose motor limits the levels are fractions of.
        joints: motor names, all of one part.
        levels: fractions of each joint's range, ascending in [0, 1].
        neighbours: how many nearest samples (in fractions of the range) each state has actions to, or "equidistant":
            the samples one step away along one joint.  When left out: 16, or all others where there are fewer.
        tie_seed: seed of the draw among equally near samples at the last rank.
        rest: fraction of its range at which every other motor of the part is kept.

    Raises:
        InvalidValue, UnknownName: with what is valid.
    """

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[str],
        levels: Sequence[float] = (0.25, 0.5, 0.75),
        neighbours: int | Literal["equidistant"] | None = None,
        tie_seed: int = 0,
        rest: float = 0.5,
    ) -> None:
        part, indices = _checked_joints(robot, joints)
        self.levels = _checked_levels(levels, len(joints))
        if not 0.0 <= rest <= 1.0:
            raise InvalidValue(f"rest={rest!r}: give the fraction of their range, 0 to 1, at which the part's other motors stay.")
        self.robot, self.part, self.joints = robot, part.name, tuple(joints)
        if neighbours is None:
            neighbours = min(NEIGHBOURS, len(self.levels) ** len(joints) - 1)
        self.neighbours, self.tie_seed, self.rest = neighbours, tie_seed, rest
        self.columns: Ints = indices - part.start
        """Where the lattice joints stand among the motors of the part, shape (d,)."""
        self._limits = robot.limits[indices]
        self._spans, self._fractions = np.ptp(self._limits, axis=1), np.array(self.levels)
        self._strides = len(self.levels) ** np.arange(len(joints))
        low, high = robot.limits[part.slice].T
        self._rest_pose = low + rest * (high - low)

        digits = lattice_digits(len(self.levels), len(joints))
        fractions = np.array(self.levels)[digits]
        self.samples: Array = self._limits[:, 0] + fractions * np.ptp(self._limits, axis=1)
        """The centre of each state, shape (S, d), in [rad]."""
        if neighbours == "equidistant":
            self.goals: Ints = equidistant_goals(digits, len(self.levels))
            """Goal state of every action, shape (S, A), -1 where a state has no such action."""
        else:
            self.goals = nearest_goals(fractions, _checked_neighbours(neighbours, len(digits)), tie_seed)
        for array in (self.samples, self.goals, self.columns):
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.samples)

    def __repr__(self) -> str:
        kind = "equidistant" if self.neighbours == "equidistant" else f"{self.neighbours} nearest"
        return f"<Lattice of {self.part}: {len(self)} states, {self.state_actions} state-actions ({kind})>"

    @property
    def state_actions(self) -> int:
        """How many pairs of a state and an action there are."""
        return int((self.goals != NO_ACTION).sum())

    def actions(self, state: int) -> Ints:
        """Goal states in ascending order: action a of the state aims at the a-th of them."""
        row: Ints = self.goals[self._checked_state(state)]
        exists: Ints = row[row != NO_ACTION]
        return exists

    def goal(self, state: int, action: int) -> int:
        """The state at whose sample the action sets the attractor."""
        goals = self.actions(state)
        if not 0 <= action < len(goals):
            raise InvalidValue(f"state {state} of {self.part} has no action {action!r}: valid are 0 to {len(goals) - 1}.")
        return int(goals[action])

    def state_of(self, q: ArrayLike) -> int:
        """The state whose sample is nearest in fractions of the joint ranges; on a border the lower one.

        `q`: rad, shape (d,): the lattice joints in their order here, or shape (n_part,): all motors of the part.  When
        both have the same length it is read as the lattice joints; `q_part[space.columns]` is right in either case.
        """
        given = np.asarray(q, dtype=np.float64)
        if given.shape == (len(self._rest_pose),) != (len(self.joints),):
            given = given[self.columns]
        if given.shape != (len(self.joints),):
            raise InvalidValue(
                f"q has shape {given.shape}: give the {len(self.joints)} lattice joints ({', '.join(self.joints)}) "
                f"or all {len(self._rest_pose)} motors of {self.part}, in rad."
            )
        if not np.isfinite(given).all():
            raise InvalidValue(f"q of {self.part} is not finite: {given.tolist()}.")
        fraction = (given - self._limits[:, 0]) / self._spans
        digits = np.abs(fraction[:, None] - self._fractions).argmin(axis=1)
        return int(digits @ self._strides)

    def target(self, state: int) -> Array:
        """The state's sample as a pose of the whole part, its other motors at rest: shape (n_part,), in [rad]."""
        pose: Array = self._rest_pose.copy()
        pose[self.columns] = self.samples[self._checked_state(state)]
        return pose

    @property
    def settings(self) -> dict[str, Any]:
        """What the space was made from and a digest of what came out, for the record of a run (plain JSON values)."""
        content = np.round(self.samples, 6).tobytes() + self.goals.astype("<i8").tobytes()
        return {
            "robot": self.robot.name,
            "joints": list(self.joints),
            "levels": list(self.levels),
            "neighbours": self.neighbours,
            "tie_seed": self.tie_seed,
            "rest": self.rest,
            "digest": hashlib.sha256(content).hexdigest()[:16],
        }

    def _checked_state(self, state: int) -> int:
        if not 0 <= state < len(self.samples):
            raise InvalidValue(f"{self.part} has no state {state!r}: valid are 0 to {len(self.samples) - 1}.")
        return state


def _checked_joints(robot: Robot, joints: Sequence[str]) -> tuple[Part, Ints]:
    if isinstance(joints, str) or len(joints) == 0:
        raise InvalidValue(f"joints={joints!r}: give a list of motor names of one part, e.g. {list(robot.motors[:2])}.")
    if len(set(joints)) < len(joints):
        raise InvalidValue(f"joints={list(joints)} names a motor twice.")
    indices = np.array([robot.motor_index(name) for name in joints], dtype=np.intp)
    parts = sorted({robot.motor_table[i].part for i in indices})
    if len(parts) > 1:
        raise InvalidValue(f"joints={list(joints)} lie in several parts ({', '.join(parts)}): make one lattice, and one agent, a part.")
    for name, (low, high) in zip(joints, robot.limits[indices], strict=True):
        if not low < high:
            raise InvalidValue(f"motor {name!r} of {robot.name} cannot move (limits {low} to {high} rad): leave it out of the lattice.")
    return robot.part(parts[0]), indices


def _checked_levels(levels: Sequence[float], joints: int) -> tuple[float, ...]:
    given = np.asarray(levels, dtype=np.float64)
    valid = given.ndim == 1 and len(given) >= 2 and (np.diff(given) > 0).all() and given[0] >= 0 and given[-1] <= 1
    if not valid:
        raise InvalidValue(f"levels={levels!r}: give at least two ascending fractions of the joint range in [0, 1], e.g. (.25, .5, .75).")
    if len(given) ** joints > MAX_STATES:
        raise InvalidValue(
            f"{len(given)} levels of {joints} joints make {len(given) ** joints} states; the limit is {MAX_STATES}. "
            "Take fewer joints, or several agents with one part each."
        )
    return tuple(given.tolist())


def _checked_neighbours(neighbours: object, states: int) -> int:
    if isinstance(neighbours, bool) or not isinstance(neighbours, int) or not 1 <= neighbours < states:
        raise InvalidValue(f'neighbours={neighbours!r}: give a whole number from 1 to {states - 1}, or "equidistant".')
    return neighbours
