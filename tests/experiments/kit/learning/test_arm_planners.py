# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import itertools

import numpy as np
import pytest

from experiments.kit.learning.arm import arm_clauses, arm_space, robot
from experiments.kit.learning.arm_planners import Belief, Learned, PlannedOnce, Repaired, Roadmap, Straight, edge, ompl_roadmap
from mobee import Model, TransitionModel

A, B, C, D = (np.array([x, y, 0.0, 0.0]) for x, y in ((0.0, 0.0), (0.0, 0.4), (0.3, 0.6), (0.6, 0.4)))
ELSEWHERE = np.array([0.0, 0.2, 0.0, 0.0])


class Free:
    span = np.ones(4)

    def sound_motion(self, start, end, cables=True):
        return bool(np.linalg.norm(end - start) < 0.5)


@pytest.fixture
def roadmap():
    """A - B, then to D directly at 0.6, or over C."""
    return Roadmap(np.array([A, B, C, D]), [(0, 1), (1, 3), (1, 2), (2, 3)], Free())


def test_a_failed_motion_is_removed_and_the_path_planned_again(roadmap):
    rival = Repaired(roadmap, {7: 3}, 1, remembers=False)
    rival.begin(7)
    aims = [rival.aim(A)]
    rival.observe(A, A)
    aims.append(rival.aim(A))
    rival.observe(A, B)
    aims.append(rival.aim(B))
    assert np.array_equal(aims, [A, B, D]) and rival.repairs == 0
    rival.observe(B, B)
    assert rival.repairs == 1
    rival.aim(B)
    rival.observe(B, B)  # back on the roadmap
    assert np.array_equal(rival.aim(B), C)


@pytest.mark.parametrize(("remembers", "second"), [(True, C), (False, D)])
def test_removed_edges_stay_removed_only_with_memory(roadmap, remembers, second):
    rival = Repaired(roadmap, {7: 3}, 1, remembers)
    for _ in range(2):
        rival.begin(7)
        rival.aim(B)
        rival.observe(B, B)
        last = rival.aim(B)
        rival.observe(B, B)
    assert np.array_equal(last, second)


def test_when_no_path_is_left_all_motions_are_tried_again(roadmap):
    rival = Repaired(roadmap, {7: 3}, 1, remembers=True)
    rival.begin(7)
    for _ in range(20):
        assert rival.aim(A) is not None
        rival.observe(A, ELSEWHERE)


def test_a_planner_without_replanning_sends_all_vertices_and_then_gives_up(roadmap):
    rival = PlannedOnce(roadmap, {7: 3}, 1)
    rival.begin(7)
    aims = [rival.aim(q) for q in (A, ELSEWHERE, ELSEWHERE)]
    assert np.array_equal(aims, [A, B, D])
    assert rival.aim(D) is None
    rival.begin(7)
    assert np.array_equal(rival.aim(A), A)


def test_going_straight_aims_at_the_goal():
    space = arm_space()
    rival = Straight(space)
    rival.begin(5)
    assert np.array_equal(rival.aim(space.samples[80]), space.samples[5])


def test_the_learned_planner_avoids_an_action_that_it_has_seen_fail():
    space = arm_space()
    rival = Learned(space, TransitionModel(space))
    rival.begin(4)
    aims = []
    for _ in range(4):
        aims.append(space.state_of(rival.aim(space.samples[0])))
        rival.observe(space.samples[0], space.samples[0])
    assert set(aims[:2]) == {1, 3} and rival.repairs == 4


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


def test_the_path_is_the_cheapest_without_the_removed_edges(square):
    assert square.path({0: 0.0}, 3, set()) == [0, 2, 3]
    assert square.path({0: 0.0}, 3, {edge(3, 2)}) == [0, 1, 3]
    assert square.path({0: 0.0}, 3, {edge(2, 3), edge(1, 0)}) is None


def test_where_to_begin_is_part_of_the_cost(square):
    assert square.path({0: 0.0, 2: 0.5}, 3, set()) == [2, 3]
    assert square.path({0: 0.0, 2: 9.0}, 3, set()) == [0, 2, 3]


def test_path_costs_equal_those_found_by_trying_all_paths():
    rng = np.random.default_rng(0)
    vertices = rng.uniform(size=(6, 4))
    edges = [pair for pair in itertools.combinations(range(6), 2) if rng.uniform() < 0.6]
    roadmap = Roadmap(vertices, edges, Plane())

    def cost(route):
        return sum(roadmap.cost(vertices[v], w) for v, w in itertools.pairwise(route))

    for goal in range(1, 6):
        inner = [v for v in range(1, 6) if v != goal]
        paths = [(0, *middle, goal) for n in range(5) for middle in itertools.permutations(inner, n)]
        possible = [route for route in paths if all(edge(v, w) in edges for v, w in itertools.pairwise(route))]
        found = roadmap.path({0: 0.0}, goal, ())
        assert (found is None) == (not possible)
        if found is not None:
            assert cost(found) == pytest.approx(min(cost(route) for route in possible))


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
