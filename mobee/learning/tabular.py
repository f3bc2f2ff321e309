# SPDX-License-Identifier: Apache-2.0
"""Plants given by tables: every action draws its outcome from given probabilities, for fast tests and known ground truth.

`ReachTable` can also reach: move its marker to a target. The module also has tables of some worlds, such as `river_swim`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from itertools import product
from math import erf, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.discrete import DiscreteSpace, InstantPlant
from mobee.learning.explorers import Draws
from mobee.learning.lattice import Lattice
from mobee.learning.neighbours import NO_ACTION, lattice_strides
from mobee.learning.space import Space
from mobee.learning.transitions import read_only
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachOutcome, ReachTarget

DRAWS = 4096  # random numbers made at a time
NEGLIGIBLE = 1e-4  # a probability

World = Callable[[Array], tuple[Array, Array]]


class TabularPlant(InstantPlant):
    """A plant for one part on which every action ends at once, in a state that is drawn by the probabilities of a table.

    The part is then exactly at the sample (the representative pose) of this state. In shapes, S is the number of states, A the largest
    number of actions of a state, and B the largest number of outcomes of an action. It is also an `OutcomeModel`: the true model of what an
    agent learns on this plant. The random choice of the n-th action depends only on the seed and n. To continue a run in another object,
    set its attributes `state` and `actions` (the number of actions so far).

    Args:
        space: the states and actions.
        outcomes: (S, A, B) the states in which each action may end.
        probabilities: (S, A, B) of the outcomes; the sum over B is 1 for each action that exists. Actions of a state with the same goal
            cannot be distinguished, so they must have the same outcomes; the actions of a `DiscreteSpace` can be distinguished.
        seed: seed of the random choices.
        start: the first state.

    Raises:
        InvalidValue: the tables do not fit the space, or are no probabilities.
    """

    def __init__(self, space: Space, outcomes: ArrayLike, probabilities: ArrayLike, seed: int = 0, start: int = 0) -> None:
        super().__init__(space)
        self.seed = seed
        self._outcomes, self._probabilities = _checked(space, outcomes, probabilities)
        self._cumulative: Array = np.cumsum(self._probabilities, axis=-1)
        self._cumulative /= np.maximum(self._cumulative[:, :, -1:], NEGLIGIBLE)
        self._action: list[dict[int, int]] = [
            {int(goal): a for a, goal in reversed(list(enumerate(space.actions(s))))} for s in range(len(space))
        ]
        self.state = start
        """The present state of the part."""
        self.actions = 0
        """Number of actions that have ended."""
        self._block, self._uniform = -1, np.empty(0)

    @property
    def outcomes(self) -> Ints:
        """The states in which each action may end, shape (S, A, B); meaningless where the probability is 0."""
        return read_only(self._outcomes)

    @property
    def probabilities(self) -> Array:
        """The probabilities of the outcomes of each action, shape (S, A, B); all 0 where there is no action (read only)."""
        return read_only(self._probabilities)

    @property
    def settings(self) -> dict[str, Any]:
        """A dict with one key, "table": a hash (a string) of the outcomes and their probabilities."""
        reached = np.where(self._probabilities > 0.0, self._outcomes, NO_ACTION).astype("<i8")
        return {"table": hashlib.sha256(reached.tobytes() + np.round(self._probabilities, 9).tobytes()).hexdigest()[:16]}

    @property
    def q(self) -> Array:
        """The positions of all motors, shape (n,), in [rad]: the part is at the sample (representative pose) of its state.

        All other parts are at home.
        """
        q = self.robot.home.copy()
        q[self.robot.part(self.space.part).slice] = self.space.target(self.state)
        return q

    def measure(self, part: str) -> Array:
        """Return the pose of the part, shape (n_part,), in [rad]: the sample (representative pose) of its present state."""
        self._check_part(part)
        return self.space.target(self.state)

    def act(self, part: str, target: Array) -> Outcome:
        """Perform the action towards `target` (n_part,) rad: draw its outcome from the table. The outcome's duration is always 1 s.

        Raises InvalidValue if the present state has no such action. `part`: must be the part of the space.
        """
        self._check_part(part)
        action = self._action_to(target)
        chosen = self._cumulative[self.state, action].searchsorted(self._draw(), side="right")
        self.state = self._outcomes.item(self.state, action, chosen)
        self.actions += 1
        return Outcome(self.space.target(self.state), settled=True, duration=1.0)

    def _action_to(self, target: Array) -> int:
        """Return the number of the action towards a target; raises InvalidValue if the state has none."""
        if isinstance(self.space, DiscreteSpace):
            return self.space.action_of(target)
        goal = self.space.state_of(target)
        action = self._action[self.state].get(goal)
        if action is None:
            raise InvalidValue(
                f"state {self.state} of {self.space.part} has no action to {goal}: valid are {self.space.actions(self.state).tolist()}."
            )
        return action

    def _draw(self) -> float:
        block, index = divmod(self.actions, DRAWS)
        if block != self._block:
            self._block, self._uniform = block, np.random.default_rng([self.seed, block]).random(DRAWS)
        return self._uniform.item(index)


class ReachTable(TabularPlant):
    """A `TabularPlant` that can also reach for a target. The target given to `present` may block transitions.

    The random numbers of the n-th action or reach depend only on the seed and n. In shapes, S is the number of states, A the largest number
    of actions of a state, and B the largest number of outcomes of an action.

    Args:
        space: the states and transitions.
        outcomes: (S, A, B) the states in which each transition may end.
        probabilities: (S, A, B) the probabilities of the outcomes, if no target blocks the transition.
        world: a function of a target's position (3,) m, called once for each position. It returns the mean remaining distance [m] of a
            reach from each state, (S,), and the probability that the target blocks each transition, (S, A). A blocked transition ends in
            its start state.
        noise: standard deviation of the remaining distance, m.
        seed: seed of all random outcomes.
        start: the first state.
    """

    def __init__(
        self,
        space: Space,
        outcomes: ArrayLike,
        probabilities: ArrayLike,
        world: World,
        noise: float = 0.0,
        seed: int = 0,
        start: int = 0,
    ) -> None:
        super().__init__(space, outcomes, probabilities, seed, start)
        self._world, self._noise = world, noise
        self._seen: dict[bytes, tuple[Array, Array]] = {}
        self._presented: tuple[Array, Array] | None = None
        self._chances = Draws("reach table")

    @property
    def settings(self) -> dict[str, Any]:
        """A hash of the tables of transitions, and the noise, as JSON values; the function `world` is not part of them."""
        return super().settings | {"noise": self._noise}

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world, in place of the previous one; None: remove it."""
        if target is None:
            self._presented = None
            return
        key = target.position.tobytes()
        if key not in self._seen:
            self._seen[key] = self._world(target.position)
        self._presented = self._seen[key]

    def act(self, part: str, target: Array) -> Outcome:
        """Perform the action of the present state whose goal has the pose `target`, (n_part,) rad; the outcome's duration is 1 s.

        If the reach target (given to `present`) blocks the action, the part stays in its state and touches the reach target. Raises
        InvalidValue if the state has no such action. `part`: must be the part of the space.
        """
        if self._presented is not None:
            action = self._action[self.state].get(self.space.state_of(target))
            if action is not None and self._chance() < self._presented[1].item(self.state, action):
                self.actions += 1
                return Outcome(self.measure(part), settled=True, duration=1.0, touched=(TARGET,))
        return super().act(part, target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Reach for the target that was given to `present`, from the present state; the part stays in this state.

        The remaining distance in the outcome is |d + e|: d is the mean distance that the function `world` gives for target and state, and e
        is normal noise. The position of the marker in the outcome is always (0, 0, 0), and its duration 2 s. `part`: the part of the space.
        `marker`: name of the marker, only for the error message. `stay`: not used. Raises InvalidValue if no target is presented, and
        UnknownName for another part.
        """
        if self._presented is None:
            raise InvalidValue(f"nothing to reach for with the {marker}: present a target first.")
        q = self.measure(part)
        missing = self._presented[0].item(self.state)
        if self._noise:
            missing = abs(missing + self._noise * float(self._chances.at(self.seed, self.actions).standard_normal()))
        self.actions += 1
        after = Outcome(q, settled=True, duration=1.0)
        return ReachOutcome(np.zeros(3), q, missing, settled=True, duration=2.0, touched=(), after=after)

    def _chance(self) -> float:
        return float(self._chances.at(self.seed, self.actions).random())


def ideal(space: Space) -> tuple[Ints, Array]:
    """Return outcomes and probabilities, each (S, A, 1), for a `TabularPlant` on which every action ends in its goal state.

    S: number of states, A: largest number of actions of a state.
    """
    exists = space.goals != NO_ACTION
    outcomes: Ints = np.where(exists, space.goals, 0)[:, :, None]
    return outcomes, exists[:, :, None].astype(np.float64)


class TabularWorld(NamedTuple):
    """A world (MDP) as tables, each (S, A, B): the states in which an action may end, their probabilities, and the reward of each outcome.

    S: number of states, A: largest number of actions of a state, B: largest number of outcomes of an action.
    """

    outcomes: Ints
    probabilities: Array
    rewards: Array

    @property
    def mean_reward(self) -> Array:
        """The expected reward of each action in each state, the sum of probability times reward over its outcomes, shape (S, A)."""
        mean: Array = (self.probabilities * self.rewards).sum(axis=-1)
        return mean


def river_swim(length: int = 6) -> TabularWorld:
    """Return a world of `length` states in a row, with a current that pushes to the left (Strehl and Littman 2008).

    Action 0 (left) always succeeds; action 1 (right) mostly fails. Right in the last state has the reward 1, left in the first state 0.005.
    A run starts in the first state. With random actions the mean number of steps to the last state grows as 3^length.
    """
    states = np.arange(length)
    left, right = np.maximum(states - 1, 0), np.minimum(states + 1, length - 1)
    outcomes = np.stack([np.stack([left, left, left], axis=1), np.stack([left, states, right], axis=1)], axis=1)
    probabilities = np.tile([[1.0, 0.0, 0.0], [0.05, 0.6, 0.35]], (length, 1, 1))
    probabilities[0, 1] = 0.0, 0.4, 0.6
    probabilities[-1, 1] = 0.4, 0.0, 0.6
    rewards = np.zeros(outcomes.shape)
    rewards[0, 0], rewards[-1, 1] = 0.005, 1.0
    return TabularWorld(outcomes, probabilities, rewards)


def deep_sea(depth: int = 10) -> TabularWorld:
    """Return a world of `depth` rows of states in a triangle; each action moves down by one row (Osband 2019).

    State r (r + 1) / 2 + c is in row r and column c <= r. Action 0 moves to the left, action 1 to the right; all outcomes are certain. From
    the last row every action leads to the top. Each move to the right costs 0.01 / depth. A move to the right in the last column of the
    last row has the reward 1; only one of 2^depth sequences of actions leads to it.
    """
    goals = []
    for row in range(depth):
        below = (row + 1) * (row + 2) // 2
        goals += [[0, 0] if row == depth - 1 else [below + max(column - 1, 0), below + column + 1] for column in range(row + 1)]
    outcomes = np.array(goals)[:, :, None]
    rewards = np.zeros(outcomes.shape)
    rewards[:, 1] = -0.01 / depth
    rewards[-1, 1] += 1.0
    return TabularWorld(outcomes, np.ones(outcomes.shape), rewards)


def half_space(
    space: Lattice,
    normal: Sequence[float] = (-1.0, 1.0, 1.0, 0.0),
    depth: float = 0.9,
    memory: float = 0.15,
    noise: tuple[float, float] = (0.01, 0.06),
) -> tuple[Ints, Array]:
    """Return outcomes and probabilities, each (S, A, B), for a `TabularPlant` on which a plane in joint space cuts off extreme poses.

    S: number of states, A and B: largest number of actions of a state and of outcomes of an action. The plane imitates cables that limit
    the robot's motion. The goal of an action is projected onto the free side of the plane, and shifted towards the start of the action. The
    action ends in a pose that is normally distributed around this point. With the default plane and three levels of each of the arm's four
    joints, in the order pitch, roll, yaw, elbow, the plane cuts off the states with low pitch, high roll and high yaw: these are the states
    number 24, 51 and 78 of the 81 states.

    Args:
        space: a lattice.
        normal: normal of the plane, towards the forbidden side: one component for each joint, in fractions of its range.
        depth: position of the plane along the normal. 0: through the samples (poses of states) that are farthest along the normal, so that
            it cuts off none; 1: through the second farthest samples; values between are interpolated.
        memory: fraction of the distance from the projected goal to the projected start by which the outcome is shifted.
        noise: standard deviation for each joint, in fractions of its range: first of actions whose goal is on the free side of the plane,
            then of all others.
    """
    if len(normal) != len(space.joints) or not any(normal):
        raise InvalidValue(f"normal={normal!r}: give one component for each of {', '.join(space.joints)}, not all 0.")
    unit = np.array(normal) / np.linalg.norm(normal)
    low, high = space.robot.limits[[space.robot.motor_index(name) for name in space.joints]].T
    samples = (space.samples - low) / (high - low)
    heights = np.unique(np.round(samples @ unit, 9))
    excess = np.maximum(samples @ unit - (heights[-1] - depth * (heights[-1] - heights[-2])), 0.0)
    settled = samples - excess[:, None] * unit
    rows = [
        [_cells(space, settled[goal] + memory * (settled[s] - settled[goal]), noise[int(excess[goal] > 0)]) for goal in space.actions(s)]
        for s in range(len(space))
    ]
    outcomes = np.zeros((*space.goals.shape, max(len(cells) for row in rows for cells in row)), dtype=np.intp)
    probabilities = np.zeros(outcomes.shape)
    for s, row in enumerate(rows):
        for a, cells in enumerate(row):
            outcomes[s, a, : len(cells)] = [state for state, _ in cells]
            probabilities[s, a, : len(cells)] = np.array([p for _, p in cells]) / sum(p for _, p in cells)
    return outcomes, probabilities


def _cells(space: Lattice, mean: Array, deviation: float) -> list[tuple[int, float]]:
    """Return pairs (state, probability) for a normally distributed pose of the joints; probabilities up to NEGLIGIBLE (1e-4) are left out.

    `mean`: (d,) mean pose, as fractions of the joints' ranges. `deviation`: standard deviation of each joint, in the same unit. A state is
    the box of poses that are nearest to its sample.
    """
    each = []
    strides = lattice_strides([len(levels) for levels in space.levels])
    for stride, levels, x in zip(strides.tolist(), space.levels, mean.tolist(), strict=True):
        borders = [(one + next_) / 2 for one, next_ in zip(levels, levels[1:], strict=False)]
        below = [0.0, *(0.5 * (1.0 + erf((border - x) / deviation / sqrt(2.0))) for border in borders), 1.0]
        share = [(stride * level, below[level + 1] - below[level]) for level in range(len(levels))]
        each.append([(step, p) for step, p in share if p > NEGLIGIBLE])
    joined = [(sum(step for step, _ in cell), float(np.prod([p for _, p in cell]))) for cell in product(*each)]
    return [(state, p) for state, p in joined if p > NEGLIGIBLE]


def _checked(space: Space, outcomes: ArrayLike, probabilities: ArrayLike) -> tuple[Ints, Array]:
    states, shares = np.array(outcomes, dtype=np.intp), np.array(probabilities, dtype=np.float64)
    if states.shape != shares.shape or states.ndim != 3 or states.shape[:2] != space.goals.shape:
        raise InvalidValue(f"tables of shapes {states.shape} and {shares.shape}: give both as (S, A, B) with (S, A) = {space.goals.shape}.")
    sums = np.where(space.goals == NO_ACTION, 0.0, 1.0)
    if not (shares >= 0).all() or np.abs(shares.sum(axis=-1) - sums).max() > 1e-9:
        raise InvalidValue("probabilities: give numbers from 0 that sum to 1 over each action's outcomes, and 0 where there is no action.")
    if ((states < 0) | (states >= len(space)))[shares > 0].any():
        raise InvalidValue(f"outcomes: valid are states 0 to {len(space) - 1}.")
    return states, shares
