"""The fewest actions that try every action of a space once, if all succeed: the open directed Chinese postman's walk."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from mobee.errors import InvalidValue
from mobee.learning.neighbours import NO_ACTION
from mobee.robot.robot import Array, Ints


def postman_floor(goals: Ints) -> int:
    """The length of the shortest walk over every action of a graph, from any state to any.

    Where more actions lead into a state than out of it, the walk has to leave it again along actions it has taken before: it goes
    shortest ways to states with the opposite lack.  A minimal assignment pairs them; one pair may stay apart, the walk's ends.

    `goals`: (S, A), -1 where there is no action.  Raises InvalidValue unless every state can be reached from every other.
    """
    from_state, action = np.nonzero(goals != NO_ACTION)
    to_state, states = goals[from_state, action], len(goals)
    distance = _distances(from_state, to_state, states)
    surplus = np.bincount(to_state, minlength=states) - np.bincount(from_state, minlength=states)
    leave = np.repeat(np.arange(states), np.maximum(surplus, 0))
    arrive = np.repeat(np.arange(states), np.maximum(-surplus, 0))
    cost = np.zeros((len(leave) + 1, len(arrive) + 1))  # the last row and column are the ends: they cost nothing
    cost[:-1, :-1] = distance[np.ix_(leave, arrive)]
    return len(from_state) + round(float(cost[linear_sum_assignment(cost)].sum()))


def _distances(from_state: Ints, to_state: Ints, states: int) -> Array:
    graph = csr_array((np.ones(len(from_state)), (from_state, to_state)), shape=(states, states))
    distance: Array = shortest_path(graph, unweighted=True)
    if not np.isfinite(distance).all():
        raise InvalidValue("some state cannot be reached from another: no walk tries every action.")
    return distance
