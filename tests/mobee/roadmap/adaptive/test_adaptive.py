# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee import AdaptiveRoadmap, Lattice, Planner
from mobee.roadmap.adaptive.adaptive import PRIOR, EdgeBeliefs
from tests.mobee.roadmap.toy_map import JOINTS, ROBOT, SQUARE, random_map, square

GOAL = 7


@pytest.mark.parametrize("mode", ["remove", "reweigh"])
@pytest.mark.parametrize("seed", range(3))
def test_its_paths_and_costs_are_those_of_value_iteration(seed, mode):
    roadmap = random_map(seed, mode=mode)
    costs = roadmap.costs(GOAL)
    values, action_values = mobee.value_iteration(roadmap.beliefs, roadmap.reward(GOAL), 1.0 - 1e-12, 1e-10)
    known = np.isfinite(costs)
    assert 10 < known.sum() and values[known] == pytest.approx(-costs[known], abs=1e-6)
    for start in np.flatnonzero(known).tolist():
        path = [start]
        while path[-1] != GOAL:
            path.append(roadmap.space.goal(path[-1], int(action_values[path[-1]].argmax())))
        assert roadmap.plan(start, GOAL) == tuple(path)


def test_the_planner_of_curious_agents_plans_on_it_and_finds_as_few_edges():
    lattice = Lattice(ROBOT, JOINTS, (0.2, 0.5, 0.8), "equidistant")
    roadmap = AdaptiveRoadmap(lattice)
    for state, action in ((0, 0), (1, 1), (13, 2)):
        roadmap.observe(state, action, state)
    planner = Planner(roadmap.space, roadmap.beliefs, [26])
    for start in (0, 1, 13):
        assert len(planner.plan(start).path) == len(roadmap.plan(start, 26))


def test_a_failed_edge_is_excluded_and_another_path_is_planned_at_once():
    roadmap = square()
    assert roadmap.plan(0, 1) == (0, 1)
    roadmap.observe(0, 0, 0)
    assert roadmap.plan(0, 1) == (0, 3, 2, 1)
    assert roadmap.plan(1, 0) == (1, 0)
    roadmap.observe(0, 1, 0)
    assert roadmap.stuck.tolist() == [0]
    with pytest.raises(mobee.MobeeError, match=r"the map has no path from vertex 0 to \[1\].*[Gg]row"):
        roadmap.plan(0, 1)


def test_a_path_does_not_go_back_and_forth_between_vertices_with_equal_poses():
    poses = SQUARE[[0, 0, 0, 1]]
    ring = AdaptiveRoadmap(mobee.Space(ROBOT, JOINTS, poses, [[1, 2, -1], [0, -1, -1], [1, 0, 3], [2, -1, -1]]))
    assert ring.plan(0, 3) == (0, 2, 3)
    assert ring.plan(1, 3) == (1, 0, 2, 3)


def test_an_observation_can_count_for_both_directions_of_an_edge():
    roadmap = square(both_ways=True)
    roadmap.observe(0, 0, 0)
    assert roadmap.plan(1, 0) == (1, 2, 3, 0)
    assert len(roadmap.unexplored) == 6


def test_an_edge_that_works_again_is_taken_again_in_either_mode():
    roadmap = square()
    roadmap.observe(0, 0, 0)
    roadmap.observe(0, 0, 1)
    assert roadmap.plan(0, 1) == (0, 1)


def test_with_reweigh_a_failed_edge_is_expensive_until_the_failure_is_forgotten():
    roadmap = square(mode="reweigh", forgetting=0.8)
    roadmap.observe(0, 0, 0)
    assert roadmap.plan(0, 1) == (0, 3, 2, 1)
    for _ in range(20):
        roadmap.observe(2, 0, 1)
    assert roadmap.plan(0, 1) == (0, 1)
    worked, failed = PRIOR
    assert roadmap.beliefs.success[0, 0] == pytest.approx(worked / (worked + failed + 0.8**20))


def test_probabilities_sum_to_one_for_every_edge_and_to_zero_where_there_is_none():
    roadmap = random_map(0, mode="reweigh", forgetting=0.9)
    roadmap.grow(np.zeros((1, 3)), 3)
    exists = roadmap.space.goals >= 0
    assert not exists.all()
    assert roadmap.beliefs.probabilities.sum(axis=-1) == pytest.approx(exists.astype(float))


def test_targets_are_drawn_in_proportion_to_untried_edges_of_reachable_vertices():
    roadmap = square()
    for action in range(2):
        roadmap.observe(0, action, roadmap.space.goal(0, action))
    roadmap.observe(1, 0, 0)
    rng = np.random.default_rng(0)
    drawn = np.bincount([roadmap.next_target(0, rng) for _ in range(500)], minlength=4)
    assert drawn[0] == 0 and drawn[1] == pytest.approx(100, abs=35) and drawn[2] == pytest.approx(200, abs=45)
    roadmap = square()
    roadmap.observe(0, 0, 0)
    roadmap.observe(0, 1, 0)
    assert roadmap.next_target(0, rng) is None


def test_growing_adds_edges_in_both_directions_and_keeps_beliefs():
    roadmap = square()
    roadmap.observe(0, 0, 0)
    new = roadmap.grow([[0.5, -0.5, 0.0]], neighbours=2)
    assert new.tolist() == [4] and roadmap.space.actions(4).tolist() == [0, 1]
    assert roadmap.plan(0, 1) == (0, 4, 1)
    assert roadmap.beliefs.tried.sum() == 1 and not roadmap.beliefs.last[0, roadmap.action(0, 1)]


def test_a_joined_path_repairs_a_vertex_without_usable_edges():
    roadmap = square()
    roadmap.observe(0, 0, 0)
    roadmap.observe(0, 1, 0)
    roadmap.join(0, [[0.3, 0.3, 0.0], [0.6, 0.6, 0.0]], 2)
    assert roadmap.plan(0, 1) == (0, 4, 5, 2, 1) and roadmap.plan(1, 0) == (1, 0)
    assert roadmap.stuck.tolist() == []


def test_pruning_removes_unreachable_vertices_and_failed_edges():
    roadmap = square()
    for state, goal in ((1, 2), (3, 2), (0, 3)):
        roadmap.observe(state, roadmap.action(state, goal), state)
    number = roadmap.prune(0)
    assert number.tolist() == [0, 1, -1, -1]
    assert np.array_equal(roadmap.space.samples, SQUARE[:2])
    assert roadmap.space.goals.tolist() == [[1], [0]]


def test_pruning_keeps_edges_that_failed_where_they_may_come_back():
    roadmap = square(mode="reweigh")
    roadmap.observe(0, 0, 0)
    assert roadmap.prune(0).tolist() == [0, 1, 2, 3] and roadmap.space.state_actions == 8
    assert roadmap.beliefs.failed[0, 0] == 1.0


@pytest.mark.parametrize(
    ("given", "complaint"),
    [({"mode": "removes"}, "Did you mean 'remove'"), ({"forgetting": 0.0}, "above 0 and at most 1"), ({"forgetting": 1.5}, "at most 1")],
)
def test_bad_settings_are_refused(given, complaint):
    with pytest.raises(mobee.MobeeError, match=complaint):
        square(**given)


def test_bad_vertices_and_samples_are_refused():
    roadmap = square()
    with pytest.raises(mobee.InvalidValue, match="Valid are 0 to 3"):
        roadmap.plan(0, 4)
    with pytest.raises(mobee.InvalidValue, match="m0, m1, m2"):
        roadmap.grow([[0.0, 0.0]])
    with pytest.raises(mobee.InvalidValue, match="sample 1 has m2 at 90: valid is -3 to 3"):
        roadmap.grow([[0.0, 0.0, 0.0], [0.0, 1.0, 90.0]])  # degrees in place of radians
    with pytest.raises(mobee.InvalidValue, match="m0 at -4"):
        roadmap.join(0, [[-4.0, 0.0, 0.0]], 2)
    assert roadmap.grow([[3.005, 0.0, 0.0]]).tolist() == [4]


@pytest.mark.parametrize("neighbours", [0, -1, 1.5])
def test_a_new_vertex_needs_neighbours(neighbours):
    with pytest.raises(mobee.InvalidValue, match="neighbours"):
        square().grow([[0.5, -0.5, 0.0]], neighbours=neighbours)


def test_beliefs_without_observations_trust_every_edge():
    goals = np.array([[1, -1], [0, 1]])
    assert EdgeBeliefs(goals).success.tolist() == [[1.0, 0.0], [1.0, 1.0]]
