# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import itertools

import numpy as np
import pytest

from experiments.kit.learning.arm import arm_clauses, robot
from experiments.kit.learning.arm_planners import Belief, Roadmap, edge, ompl_roadmap
from mobee import Model


class Plane:
    """A belief about four joints in which a motion is sound unless it goes through a wall at 0.5 of the first joint."""

    span = np.ones(4)

    def sound_motion(self, start, end, cables=True):
        return (start[0] - 0.5) * (end[0] - 0.5) > 0.0


def pose(x, y=0.0):
    return np.array([x, y, 0.0, 0.0])


@pytest.fixture
def square():
    """0 - 1 - 3 is long, 0 - 2 - 3 short."""
    vertices = np.array([pose(0.0), pose(0.0, 3.0), pose(0.1, 0.5), pose(0.2, 1.0)])
    return Roadmap(vertices, [(0, 1), (1, 3), (0, 2), (2, 3)], Plane())


def test_the_way_is_the_cheapest_and_detours_around_what_was_taken_out(square):
    assert square.path({0: 0.0}, 3, set()) == [0, 2, 3]
    assert square.path({0: 0.0}, 3, {edge(3, 2)}) == [0, 1, 3]
    assert square.path({0: 0.0}, 3, {edge(2, 3), edge(1, 0)}) is None


def test_ways_cost_what_trying_all_of_them_finds():
    rng = np.random.default_rng(0)
    vertices = rng.uniform(size=(6, 4))
    edges = [pair for pair in itertools.combinations(range(6), 2) if rng.uniform() < 0.6]
    roadmap = Roadmap(vertices, edges, Plane())

    def cost(way):
        return sum(roadmap.cost(vertices[v], w) for v, w in itertools.pairwise(way))

    for goal in range(1, 6):
        inner = [v for v in range(1, 6) if v != goal]
        ways = [(0, *middle, goal) for n in range(5) for middle in itertools.permutations(inner, n)]
        possible = [way for way in ways if all(edge(v, w) in edges for v, w in itertools.pairwise(way))]
        found = roadmap.path({0: 0.0}, goal, ())
        assert (found is None) == (not possible)
        if found is not None:
            assert cost(found) == pytest.approx(min(cost(way) for way in possible))


def test_a_vertex_is_joined_by_sound_motions_only_and_by_all_if_there_are_none(square):
    here = square.add(pose(0.3, 1.0), 4)
    assert square.path({here: 0.0}, 3, ()) == [here, 3]
    beyond = square.add(pose(0.9, 1.0), 2)
    assert square.path({beyond: 0.0}, 3, {edge(beyond, 3)}) == [beyond, here, 3]


class Held(Plane):
    """As the plane, but all of it is too near to the cables."""

    def sound_motion(self, start, end, cables=True):
        return not cables and super().sound_motion(start, end)


def test_a_pose_held_by_the_cables_is_joined_where_nothing_touches():
    roadmap = Roadmap(np.array([pose(0.4), pose(0.6)]), [], Held())
    assert roadmap.reachable(pose(0.45), 2) == [0]


def test_a_roadmap_follows_from_its_seed_and_holds_only_sound_poses_and_motions():
    pytest.importorskip("ompl")
    belief = Belief(Model(robot()), np.zeros(4), arm_clauses())
    first, again, other = (ompl_roadmap(belief, 30, 5, seed) for seed in (3, 3, 4))
    assert len(first.vertices) >= 30 and first.edges > 30
    assert np.array_equal(first.vertices, again.vertices) and first.edges == again.edges
    assert not np.array_equal(first.vertices[:30], other.vertices[:30])
    assert belief.sound(first.vertices).all()
    for vertex in range(5):
        for other_vertex in first._costs[vertex]:
            assert belief.sound_motion(first.vertices[vertex], first.vertices[other_vertex])
