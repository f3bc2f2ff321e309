# SPDX-License-Identifier: Apache-2.0
"""Beliefs about the edges of an adaptive roadmap, and the roadmap as the state space of an agent (thesis 4.2, 9.4.5)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.neighbours import NO_ACTION, joined, table_of
from mobee.learning.space import Space, checked_joints
from mobee.roadmap.roadmap import Roadmap

Mode = Literal["remove", "reweigh"]
MODES = ("remove", "reweigh")
PRIOR = (0.2, 0.01)  # imagined successes and failures of every edge: optimistic, and small compared with real observations


class EdgeBeliefs:
    """Beliefs about the outcomes of edges: an edge ends at its goal with probability p, or else at the vertex where it began.

    The class has the interface of `mobee.learning.value_iteration.OutcomeModel`, so planners can use it.

    Args:
        goals: (S, A) goal vertex of each edge; row: vertex where the edge begins (S vertices), column: number of the edge there (at most
            A edges); NO_ACTION (-1) where there is no edge.
        mode: "remove": a failed edge is excluded (p = 0) until it succeeds; all other edges have p = 1 (thesis). "reweigh": p is the mean
            of a Beta distribution over weighted counts of successes and failures.
        forgetting: factor on all counts at each observation of any edge, in (0, 1], so that old failures are forgotten; no effect with
            "remove".
    """

    def __init__(self, goals: Ints, mode: Mode = "remove", forgetting: float = 1.0) -> None:
        if mode not in MODES:
            raise UnknownName("mode", mode, MODES)
        if not 0.0 < forgetting <= 1.0:
            raise InvalidValue(f"forgetting={forgetting!r}: valid is a factor above 0 and at most 1.")
        self.mode: Mode = mode
        self.forgetting = forgetting
        self.goals = goals
        self.worked: Array = np.zeros(goals.shape)
        """Weighted number of successes of each edge, shape (S, A)."""
        self.failed: Array = np.zeros(goals.shape)
        """Weighted number of failures of each edge, shape (S, A)."""
        self.tried: Ints = np.zeros(goals.shape, dtype=np.intp)
        """Number of observations of each edge, shape (S, A)."""
        self.last: NDArray[np.bool_] = goals != NO_ACTION
        """Whether each edge ended at its goal when it was last observed, shape (S, A); True for edges that were never observed."""

    @property
    def success(self) -> Array:
        """The probability that an edge ends at its goal, shape (S, A), 0 where there is no edge."""
        if self.mode == "remove":
            return np.where(self.last, 1.0, 0.0)
        worked, failed = PRIOR
        p: Array = (worked + self.worked) / (worked + failed + self.worked + self.failed)
        return np.where(self.goals == NO_ACTION, 0.0, p)

    @property
    def outcomes(self) -> Ints:
        """The two possible end vertices of each edge, shape (S, A, 2): its goal, and the vertex where it began."""
        began = np.broadcast_to(np.arange(len(self.goals))[:, None], self.goals.shape)
        return np.stack([np.where(self.goals == NO_ACTION, began, self.goals), began], axis=-1)

    @property
    def probabilities(self) -> Array:
        """Probabilities of the two `outcomes` of each edge, shape (S, A, 2); both are 0 where there is no edge."""
        p = self.success
        return np.stack([p, np.where(self.goals == NO_ACTION, 0.0, 1.0 - p)], axis=-1)

    def observe(self, state: int, action: int, arrived: bool) -> None:
        """Count a try of the edge `action` of vertex `state`; `arrived`: whether the motion ended at the goal of the edge."""
        if self.forgetting < 1.0:
            self.worked *= self.forgetting
            self.failed *= self.forgetting
        counts = self.worked if arrived else self.failed
        counts[state, action] += 1.0
        self.tried[state, action] += 1
        self.last[state, action] = arrived

    def moved(self, goals: Ints, states: Ints, actions: Ints, before: tuple[Ints, Ints]) -> EdgeBeliefs:
        """Return a copy of these beliefs for a changed graph with the table `goals` (S', A').

        `states`, `actions` (E,): rows and columns in the new table of the E edges that are in both tables. `before`: (rows, columns) of the
        same edges in the old table. All other edges of the new table start without observations.
        """
        found = EdgeBeliefs(goals, self.mode, self.forgetting)
        for name in ("worked", "failed", "tried", "last"):
            getattr(found, name)[states, actions] = getattr(self, name)[before]
        return found


DECIMALS = 9  # of rad: poses that are equal to this precision are one


def roadmap_space(roadmap: Roadmap, joints: Sequence[str] | None = None) -> Space:
    """Return a space whose states are a roadmap's poses and whose actions are its edges, in both directions.

    States are the vertices of the map's largest connected component, in their order; all other vertices are left out. Vertices that have
    the same positions of `joints` become one state. The part's motors that are not in `joints` do not move: they keep the
    positions that they have in the first vertex of this component.

    Args:
        roadmap: e.g. of `mobee.build_roadmap`.
        joints: names of motors of one part of the robot; None: the motors that may move in the map.

    Raises:
        InvalidValue, UnknownName: the joints belong to several parts, a name is unknown, or no edge joins two different states.
    """
    robot = roadmap.model.robot
    names = tuple(roadmap.motors if joints is None else joints)
    moving = {robot.motor_table[robot.motor_index(name)].part for name in names}
    if joints is None and len(moving) > 1:
        raise InvalidValue(
            f"the map moved {', '.join(sorted(moving))}, an agent has one part: give joints=[...] of one, "
            "or build a map with its motors only."
        )
    part, columns = checked_joints(robot, names)
    kept = np.flatnonzero(roadmap.graph.components == 0)
    _, first, number = np.unique(np.round(roadmap.q[np.ix_(kept, columns)], DECIMALS), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), dtype=np.intp)
    rank[order] = np.arange(len(order))
    states = np.full(len(roadmap.q), -1)
    states[kept] = rank[number.ravel()]
    ends = states[roadmap.edges]
    ends = ends[(ends >= 0).all(axis=1) & (ends[:, 0] != ends[:, 1])]
    if not len(ends):
        raise InvalidValue("the map has no edge between two poses of these joints: build it with more neighbours, or a larger `longest`.")
    edges = joined([(int(s), int(g)) for s, g in np.concatenate([ends, ends[:, ::-1]])])
    low, high = robot.limits[part.slice].T
    rest = np.clip((roadmap.q[kept[0], part.slice] - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    return Space(robot, names, roadmap.q[np.ix_(kept[first[order]], columns)], table_of(edges, len(order)), rest.tolist())
