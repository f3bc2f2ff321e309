"""A roadmap as the state space of an agent: poses that somebody wanted instead of a lattice (thesis 9.4.5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee.errors import InvalidValue
from mobee.learning.edge_table import joined, table_of
from mobee.learning.space import Space, checked_joints
from mobee.roadmap.roadmap import Roadmap

DECIMALS = 9  # rad: poses that agree to here are one


def roadmap_space(roadmap: Roadmap, joints: Sequence[str] | None = None) -> Space:
    """The states and actions that a roadmap's poses and edges are, in both ways.

    States are the vertices of the map's largest connected part, in their order; what is apart from it cannot be come to.
    Vertices that differ in other motors than the joints alone are one state.  The part's other motors rest where the map has them.

    Args:
        roadmap: e.g. of `mobee.build_roadmap`.
        joints: motor names of one part; None: those that moved when the map was made.

    Raises:
        InvalidValue, UnknownName: joints of several parts, or less than two states.
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
