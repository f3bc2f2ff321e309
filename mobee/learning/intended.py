"""The graph that a planner would have without experience: every action reaches its goal (a PRM, thesis 3.1.2)."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array, Ints


def steps_between(space: Space, start: int, targets: Ints) -> int:
    """Actions of a shortest path from a state to the nearest target if every action reaches its goal; -1 if there is none."""
    fewest = _steps(_graph(space), np.array([start]))[targets].min()
    return int(fewest) if np.isfinite(fewest) else -1


def shortest_actions(space: Space, beliefs: OutcomeModel, start: int, targets: Ints) -> dict[tuple[int, int], float]:
    """The actions on the shortest intended paths, as (state, goal), with the believed probability that each ends at its goal."""
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
    """The states between such actions, with the probability of the best way in and out of each."""
    entry: dict[int, float] = {}
    leaving: dict[int, float] = {}
    for (state, goal), chance in actions.items():
        entry[goal] = max(entry.get(goal, 0.0), chance)
        leaving[state] = max(leaving.get(state, 0.0), chance)
    return {state: entry[state] * leaving[state] for state in sorted(entry.keys() & leaving.keys())}


def _graph(space: Space) -> Any:
    """A sparse matrix (S, S) with an entry where an action leads from a state to another one."""
    from scipy.sparse import csr_array

    states, actions = np.nonzero(space.goals != NO_ACTION)
    shape = (len(space), len(space))
    return csr_array((np.ones(len(states)), (states, space.goals[states, actions])), shape=shape)


def _steps(graph: Any, sources: Ints) -> Array:
    """Edges from the nearest of the sources to each state, shape (S,), infinite where there is no way."""
    from scipy.sparse.csgraph import dijkstra

    found: Array = dijkstra(graph, indices=sources, unweighted=True, min_only=True)
    return found
