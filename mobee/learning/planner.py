# SPDX-License-Identifier: Apache-2.0
"""Plans paths from any state to target states with a learned model, and finds the shortest paths for comparison.

A shortest path has the fewest actions if every action reaches its goal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, MobeeError
from mobee.learning.goal import target_states
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel, require_beliefs_of, value_iteration


def steps_between(space: Space, start: int, targets: Ints) -> int:
    """Return the number of actions on a shortest path from `start` to the nearest of `targets`; -1 if there is no path.

    It assumes that every action reaches its goal.
    """
    fewest = _steps(_graph(space), np.array([start]))[targets].min()
    return int(fewest) if np.isfinite(fewest) else -1


def shortest_actions(space: Space, beliefs: OutcomeModel, start: int, targets: Ints) -> dict[tuple[int, int], float]:
    """Return the actions that lie on a shortest path from `start` to the nearest of `targets`, and their probabilities of success.

    The paths assume that every action reaches its goal. The result is a dict from (state, goal state) of an action to the probability,
    according to `beliefs`, that the action ends in its goal state. It is empty if there is no path.
    """
    graph = _graph(space)
    there, on = _steps(graph, np.array([start])), _steps(graph.T.tocsr(), targets)
    if not np.isfinite(on[start]):
        return {}
    states, actions = np.nonzero((space.goals != NO_ACTION) & (there[:, None] + 1.0 + on[space.goals] == on[start]))
    goals = space.goals[states, actions]
    ends_there = beliefs.outcomes[states, actions] == goals[:, None]
    chances = np.where(ends_there, beliefs.probabilities[states, actions], 0.0).sum(axis=1)
    return dict(zip(zip(states.tolist(), goals.tolist(), strict=True), chances.tolist(), strict=True))


def passing(actions: dict[tuple[int, int], float]) -> dict[int, float]:
    """Return for each state the probability that an agent can pass through it: enter it, and leave it again, by the most reliable actions.

    `actions`: a dict from (state, goal state) of an action to its probability of success. The result is a dict from a state to the highest
    probability of the actions that lead to it, times the highest probability of the actions that start in it. States that lack either kind
    of action are left out.
    """
    entry: dict[int, float] = {}
    leaving: dict[int, float] = {}
    for (state, goal), chance in actions.items():
        entry[goal] = max(entry.get(goal, 0.0), chance)
        leaving[state] = max(leaving.get(state, 0.0), chance)
    return {state: entry[state] * leaving[state] for state in sorted(entry.keys() & leaving.keys())}


def _graph(space: Space) -> Any:
    """Return a sparse matrix (S, S) with an entry for each action from a state to its goal."""
    from scipy.sparse import csr_array

    states, actions = np.nonzero(space.goals != NO_ACTION)
    shape = (len(space), len(space))
    return csr_array((np.ones(len(states)), (states, space.goals[states, actions])), shape=shape)


def _steps(graph: Any, sources: Ints) -> Array:
    """Return the number of edges from the nearest source to each state, shape (S,), infinite if there is no path.

    `graph`: sparse matrix (S, S), as `_graph` returns it. `sources`: indices of states.
    """
    from scipy.sparse.csgraph import dijkstra

    found: Array = dijkstra(graph, indices=sources, unweighted=True, min_only=True)
    return found


DISCOUNT = 0.99  # near 1, the state with the fewest actions on average to a target has the largest value
TOLERANCE = 1e-12  # of values in [0, 1]
RELIABLE = 0.5  # success probability below which states and actions count as unreliable


@dataclass(frozen=True, slots=True)
class Plan:
    """A path to a target, and its probability of success.

    `path`: states from start to target. `actions`: the action in each state of the path except the last. `probabilities`: the probability
    that each action ends in the next state of the path; `success`: the product of them. `steps`: mean number of actions to a target if the
    agent plans again after each action; infinite if it may come to a state without a known path. `shortest`: number of actions on a
    shortest path if every action reached its goal.

    Two dicts explain why this path is longer than a shortest path. `avoided`: states that are on a shortest path, but not on this path. The
    value of a state is the probability that the agent can enter it, and leave it again, by actions on shortest paths (see `passing`).
    `distrusted`: actions on shortest paths, as (state, goal state). The value of an action is the probability that it ends in its goal.
    Both contain only states and actions whose probability is below one half.
    """

    path: tuple[int, ...]
    actions: tuple[int, ...]
    probabilities: tuple[float, ...]
    success: float
    steps: float
    shortest: int
    avoided: dict[int, float]
    distrusted: dict[tuple[int, int], float]


class Planner:
    """Finds paths to target states that need few actions on average; an action that fails and must be repeated counts again.

    Args:
        space: states and actions.
        beliefs: outcomes of the actions and their probabilities, e.g. `model.debiased()` of a `TransitionModel`. The probabilities of
            `model` itself include failures that were only assumed before the first try, so reliable actions that were rarely tried would
            seem unreliable.
        targets: one or more states.
        discount: factor per step, in [0, 1); with a smaller one, a short path is preferred more over a reliable path.

    Raises:
        InvalidValue: no such state, or beliefs of another space.
    """

    def __init__(self, space: Space, beliefs: OutcomeModel, targets: Any, discount: float = DISCOUNT) -> None:
        require_beliefs_of(space.goals, beliefs)
        self.space, self.beliefs, self.discount = space, beliefs, discount
        self.targets: Ints = target_states(space, targets)
        """The states to reach, ascending."""
        reward, values = np.zeros(space.goals.shape), np.zeros(len(space))
        reward[self.targets], values[self.targets] = -np.inf, 1.0  # no actions in targets: they keep their value
        self.values, action_values = value_iteration(beliefs, reward, discount, TOLERANCE, values)
        """The discounted value of being in each state, shape (S,): 1 in a target, 0 where no action leads to one."""
        self.policy: Ints = action_values.argmax(axis=1)
        """The action to take in each state, shape (S,); meaningless in a target and where the value is 0."""

    def plan(self, start: int) -> Plan:
        """Return the plan from the state `start`.

        Raises InvalidValue if there is no such state, MobeeError if no path to a target is known, or if the value of the start is too small
        to be computed.
        """
        if len(path := target_states(self.space, start).tolist()) != 1:
            raise InvalidValue(f"start {start!r}: give the number of one state.")
        probabilities: list[float] = []
        while path[-1] not in self.targets:
            following, probability = self._next(path[-1])
            path.append(following)
            probabilities.append(probability)
        intended = shortest_actions(self.space, self.beliefs, path[0], self.targets)
        return Plan(
            path=tuple(path),
            actions=tuple(int(self.policy[state]) for state in path[:-1]),
            probabilities=tuple(probabilities),
            success=float(np.prod(probabilities)),
            steps=self._mean_steps(path[0]),
            shortest=steps_between(self.space, path[0], self.targets),
            avoided={state: chance for state, chance in passing(intended).items() if chance < RELIABLE and state not in path},
            distrusted={action: chance for action, chance in intended.items() if chance < RELIABLE},
        )

    def _next(self, state: int) -> tuple[int, float]:
        """Return the most probable outcome that is nearer to a target, and its probability."""
        outcomes, probabilities = self._outcomes(state)
        nearer = np.where(self.values[outcomes] > self.values[state], probabilities, 0.0)
        if self.values[state] <= 0.0 or not nearer.any():
            raise MobeeError(
                f"no path is known from state {state} of {self.space.part} to {self.targets.tolist()}, or it is so long or so unreliable "
                f"that with discount={self.discount:g} its value is below {TOLERANCE:g}: try other states, or a discount nearer to 1."
            )
        best = int(nearer.argmax())
        return int(outcomes[best]), float(probabilities[best])

    def _outcomes(self, state: int) -> tuple[Ints, Array]:
        action = self.policy[state]
        return self.beliefs.outcomes[state, action], self.beliefs.probabilities[state, action]

    def _mean_steps(self, start: int) -> float:
        """Return the mean number of actions to a target: a linear system over the states that the policy can reach."""
        from scipy.sparse import csr_array, identity  # 0.4 s, imported only for plans
        from scipy.sparse.csgraph import breadth_first_order
        from scipy.sparse.linalg import spsolve

        states = np.arange(len(self.space))
        probabilities = self.beliefs.probabilities[states, self.policy]
        probabilities[self.targets] = 0.0
        rows = np.repeat(states, probabilities.shape[1])
        outcomes = self.beliefs.outcomes[states, self.policy]
        moves = csr_array((probabilities.ravel(), (rows, outcomes.ravel())), shape=(len(states), len(states)))
        moves.eliminate_zeros()
        reached = np.sort(breadth_first_order(moves, start, return_predecessors=False))
        if (self.values[reached] <= 0.0).any():
            return float("inf")
        costs = (~np.isin(reached, self.targets)).astype(np.float64)
        steps = spsolve((identity(len(reached)) - moves[reached][:, reached]).tocsc(), costs)
        return float(np.atleast_1d(steps)[np.searchsorted(reached, start)])
