# SPDX-License-Identifier: Apache-2.0
"""The reaches of a space, one from each state, and plans that end in a reach (thesis 8.2, 8.3.1).

A reach is an action in which a force pulls a marker from the pose of a state to a target. `Reaches` has the marker's position and Jacobian
at the pose in which each reach begins. For plans, every state has one more action, the reach, after which the plan ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel, require_beliefs_of, value_iteration
from mobee.model.model import Model

SCALE = 0.01  # m, unit of distances in the published equations; the thesis leaves it open
REACH = -1  # number of the reach action of a state, in records and among its action values
TOLERANCE = 1e-6  # of values; the largest are about 1


@dataclass(frozen=True, slots=True, eq=False)
class Reaches:
    """The reaches of a space, one for each state; a reach is an action that pulls a marker from the pose of the state to a target.

    `samples`: (S, d) rad, poses of the joints at which the reaches begin. `hands`: (S, 3) m, root frame, position of the marker in each of
    them. `scale`: unit of distances in thesis eqs. 8.1, 8.4, 8.5 and 8.7, m. `jacobians`: (S, 3, d) m/rad, derivative of the marker's
    position with respect to the joints; None: unknown.
    """

    samples: Array
    hands: Array
    scale: float = SCALE
    jacobians: Array | None = None

    def __post_init__(self) -> None:
        """Check shapes and values; raises InvalidValue."""
        if self.samples.ndim != 2 or self.hands.shape != (len(self.samples), 3):
            raise InvalidValue(
                f"samples of shape {self.samples.shape}, hands of {self.hands.shape}: give (S, d) rad and (S, 3) m, one row per state."
            )
        shape = len(self.samples), 3, self.samples.shape[1]
        if self.jacobians is not None and not (self.jacobians.shape == shape and np.isfinite(self.jacobians).all()):
            raise InvalidValue(f"jacobians of shape {self.jacobians.shape}: give finite m/rad, one (3, d) a state, in all {shape}.")
        if not (np.isfinite(self.samples).all() and np.isfinite(self.hands).all() and 0.0 < self.scale < np.inf):
            raise InvalidValue(f"samples, hands and scale={self.scale!r}: all must be finite, and the scale a length above 0 m.")

    def __len__(self) -> int:
        return len(self.samples)


def reaches_of(space: Space, marker: str, scale: float = SCALE) -> Reaches:
    """Compute the marker's position and Jacobian in each state of a space, with all other parts at home.

    A state stands for a pose of its joints; the other motors of the part are at `space.rest`. `scale`: unit of distances in thesis eqs.
    8.1, 8.4, 8.5 and 8.7, m. Raises UnknownName if the robot has no such marker, InvalidValue if the joints of the space do not move it.
    """
    robot = space.robot
    part = robot.part(space.part)
    jacobians = Model(robot).jacobian(_poses(space), marker)[:, :3, part.start + space.columns]
    return Reaches(space.samples, hands_of(space, marker), scale, jacobians)


def hands_of(space: Space, marker: str) -> Array:
    """Compute the marker's position in the sample of each state, shape (S, 3), in [m] in the root frame.

    The sample is the pose that stands for the state. The other motors of the part are at `space.rest`, and all other parts are at home.
    Raises UnknownName if the robot has no such marker, InvalidValue if the marker has the same position in all states.
    """
    robot = space.robot
    robot.marker(marker)
    hands = Model(robot).evaluate(_poses(space)).position(marker)
    if np.ptp(hands, axis=0).max() == 0.0:
        raise InvalidValue(f"the marker {marker!r} is moved by none of {', '.join(space.joints)}: take one that {space.part} carries.")
    return hands


class ReachPlanning:
    """Computes the values of states and actions for plans that end in a reach.

    The method `values` gets the rewards and returns the values. It plans with the outcome probabilities of `beliefs` and two additions.
    Each of the S states has one more action after its A transitions, the reach, with index A. The reach always leads to one more state,
    the end of the plan, with index S. The object itself is the `OutcomeModel` with these additions.

    Args:
        space: states and transitions.
        beliefs: outcome probabilities of the transitions.
        discount: factor per step, in [0, 1).
    """

    def __init__(self, space: Space, beliefs: OutcomeModel, discount: float) -> None:
        require_beliefs_of(space.goals, beliefs)
        self.discount, self._beliefs = discount, beliefs
        self._states, self._actions = space.goals.shape
        self._reward: Array = np.full((self._states + 1, self._actions + 1), -np.inf)
        self.refresh()

    @property
    def outcomes(self) -> Ints:
        """The states in which each action may end, shape (S + 1, A + 1, B); B: largest number of outcomes of an action.

        The state with index S is the end of the plan, the action with index A is the reach.
        """
        return self._outcomes

    @property
    def probabilities(self) -> Array:
        """The probabilities of `outcomes`, shape (S + 1, A + 1, B); all 0 in the state with index S, which is the end of the plan."""
        return self._probabilities

    def refresh(self) -> None:
        """Copy outcomes and probabilities again from the model `beliefs` (see the constructor), after that model has changed."""
        states, actions = self._states, self._actions
        bins = self._beliefs.probabilities.shape[2]
        self._outcomes: Ints = np.full((states + 1, actions + 1, bins), states, dtype=np.int64)
        self._probabilities: Array = np.zeros(self._outcomes.shape)
        self._outcomes[:states, :actions] = self._beliefs.outcomes
        self._probabilities[:states, :actions] = self._beliefs.probabilities
        self._probabilities[:states, actions, 0] = 1.0

    def values(self, reaches: Array, moves: Array | float) -> tuple[Array, Array]:
        """Compute the values of states V (S,) and of actions Q (S, A + 1); the last column of Q is the reach.

        `reaches`: (S,) rewards of a reach from each state, -inf where no reach is allowed. `moves`: (S, A) rewards of the transitions, or
        one number for all.
        """
        self._reward[:-1, :-1], self._reward[:-1, -1] = moves, reaches
        start = np.append(np.where(reaches == -np.inf, 0.0, reaches), 0.0)  # the values of reaching at once
        values, action_values = value_iteration(self, self._reward, self.discount, TOLERANCE, start, method="modified")
        return values[:-1], action_values[:-1]


@dataclass(frozen=True, slots=True)
class ReachPlan:
    """A path to a state, and a reach (a motion in which a force pulls a marker to a target) that starts in this state.

    `path`: states from the start to the state of the reach. `actions`: the action in each state of the path except the last.
    `probabilities`: the probability that each action ends in the next state of the path; `success`: the product of them. `state`: where the
    reach starts. `expected`: expected reward of the reach (thesis eq. 8.4). `avoided`: transitions, as (state, goal state), that the path
    would contain if no failure were remembered.
    """

    path: tuple[int, ...]
    actions: tuple[int, ...]
    probabilities: tuple[float, ...]
    success: float
    state: int
    expected: float
    avoided: tuple[tuple[int, int], ...]


def plan_reach(space: Space, planning: ReachPlanning, expected: Array, failures: Array, start: int) -> ReachPlan:
    """Compute the path from the state `start`, and the reach at its end, that have the highest value.

    `expected`: (S,) expected reward of the reach from each state; the caller replaces negative values by 0. `failures`: (S, A) rewards of
    the transitions, below 0 for those that have failed. Raises InvalidValue if the space has no state `start`.
    """
    space.actions(start)
    path, actions, probabilities = _best_path(planning, start, *planning.values(expected, failures))
    free_path, free_actions, _ = _best_path(planning, start, *planning.values(expected, 0.0))
    taken = set(zip(path, actions, strict=False))
    avoided = [(s, a) for s, a in zip(free_path, free_actions, strict=False) if failures[s, a] < 0.0 and (s, a) not in taken]
    return ReachPlan(
        path=tuple(path),
        actions=tuple(actions),
        probabilities=tuple(probabilities),
        success=float(np.prod(probabilities)),
        state=path[-1],
        expected=float(expected[path[-1]]),
        avoided=tuple((s, space.goal(s, a)) for s, a in avoided),
    )


def _best_path(planning: ReachPlanning, start: int, values: Array, action_values: Array) -> tuple[list[int], list[int], list[float]]:
    """Follow the best actions from `start` and return the states, the actions and the probability of each move.

    From each state, the path leads to the most probable outcome among those of higher value. It ends where the best action is the reach, or
    where no outcome has a higher value. The list of states has one element more than the other two.
    """
    path, actions, chances = [start], list[int](), list[float]()
    best = action_values.argmax(axis=1)
    while best[path[-1]] != action_values.shape[1] - 1:
        here, action = path[-1], int(best[path[-1]])
        outcomes, probabilities = planning.outcomes[here, action], planning.probabilities[here, action]
        nearer = np.where(values[outcomes] > values[here], probabilities, 0.0)
        if not nearer.any():
            break  # no state of higher value can be reached
        likeliest = int(nearer.argmax())
        path.append(int(outcomes[likeliest]))
        actions.append(action)
        chances.append(float(probabilities[likeliest]))
    return path, actions, chances


def _poses(space: Space) -> Array:
    """Return the positions of all motors of the robot in each state, (S, n) rad."""
    robot = space.robot
    q = np.tile(robot.home, (len(space), 1))
    q[:, robot.part(space.part).slice] = [space.target(state) for state in range(len(space))]
    return q
