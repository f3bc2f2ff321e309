# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.roadmap.adaptive.record import MapStore
from mobee.roadmap.adaptive.walker import MapExplorer, Walker
from tests.mobee.roadmap.toy_map import JOINTS, ROBOT, SQUARE, BlockedPlant, random_map, square, wall

A, B, C, D = SQUARE


def test_after_a_failed_edge_the_part_moves_back_and_takes_another_path():
    plant = BlockedPlant(A, wall(A, B))
    walk = Walker(square(), plant).go(1)
    assert (walk.arrived, walk.edges, walk.bumps) == (True, 4, 1)
    assert np.array_equal(plant.acted, [B, A, D, C, B])


def test_it_can_continue_at_once_from_the_stop_without_moving_back():
    plant = BlockedPlant(A, wall(A, B))
    assert Walker(square(), plant, back=False).go(1).arrived
    assert np.array_equal(plant.acted, [B, D, C, B])


def test_going_on_at_once_that_fails_too_ends_where_it_began():
    way_on = wall(0.5 * (A + B), D)
    plant = BlockedPlant(A, lambda q, target: wall(A, B)(q, target) or way_on(q, target))
    assert Walker(square(), plant, back=False).go(1).arrived
    assert np.array_equal(plant.acted, [B, D, A, D, C, B])


def test_a_wall_that_went_away_is_found_out_by_a_map_that_forgets():
    blocked = [True]
    plant = BlockedPlant(A, lambda q, target: blocked[0] and wall(A, B)(q, target))
    walker = Walker(square(mode="reweigh", forgetting=0.7), plant)
    assert walker.go(1).bumps == 1
    blocked[0] = False
    for goal in (2, 1, 2, 1, 3, 0) * 2:
        walker.go(goal)
    assert walker.go(1).edges == 1


def test_beside_the_map_it_goes_to_the_nearest_vertex_first():
    plant = BlockedPlant(np.array([0.7, 0.1, 0.0]), lambda q, target: False)
    walker = Walker(square(), plant)
    assert walker.enter() == 1 and np.array_equal(plant.acted, [B])
    assert walker.go(1).edges == 0


def test_it_ends_after_a_number_of_edges_or_without_a_path():
    walker = Walker(square(), BlockedPlant(A, lambda q, target: False))
    assert not walker.go(2, most=1).arrived
    nowhere = Walker(square(), BlockedPlant(A, lambda q, target: np.allclose(q, A)))
    with pytest.raises(mobee.MobeeError, match="the map has no path"):
        nowhere.go(2)


def test_exploring_distinguishes_free_edges_from_blocked_ones():
    roadmap = mobee.AdaptiveRoadmap(random_map(3).space)
    samples = roadmap.space.samples

    def blocked(q, target):
        return (q == samples).all(axis=1).any() and np.linalg.norm(q - target) > 2.5

    plant = BlockedPlant(samples[0], blocked)
    explorer = MapExplorer(roadmap, plant, seed=4)
    assert explorer.explore()
    reached = roadmap.reachable(explorer.here)
    assert 5 < reached.sum() < 25 and (roadmap.beliefs.tried[reached] > roadmap.feasible[reached]).sum() > 5
    for state, action in np.argwhere(roadmap.space.goals >= 0).tolist():
        goal = roadmap.space.goal(state, action)
        if reached[state]:
            assert roadmap.feasible[state, action] != blocked(samples[state], samples[goal])


def test_when_stuck_it_queries_a_path_and_joins_it_to_the_map():
    roadmap = square()
    plant = BlockedPlant(A, lambda q, target: np.allclose(q, A) and not np.allclose(target, [0.3, 0.3, 0.0]))
    asked = []

    def query(q, goals):
        asked.append(goals)
        return np.array([q, [0.3, 0.3, 0.0], goals[1]])

    explorer = MapExplorer(roadmap, plant, query=query)
    assert explorer.explore()
    assert explorer.repairs == 1 and len(roadmap) == 5 and len(asked) == 1
    assert len(roadmap.unexplored) == 0 and roadmap.stuck.tolist() == []


def test_without_a_query_it_stays_where_it_is_stuck():
    explorer = MapExplorer(square(), BlockedPlant(A, lambda q, target: np.allclose(q, A)))
    assert explorer.explore() and explorer.here == 0


def test_an_explorer_that_is_started_again_continues_with_its_map(tmp_path):
    def started():
        store = MapStore(tmp_path / "map.sqlite", "arm")
        return MapExplorer(square(), BlockedPlant(A, wall(A, B)), store=store)

    first = started()
    first.explore(3)
    first.record.change("grow", samples=[[0.5, 0.5, 0.0]], neighbours=2)
    first.explore(3)
    again = started()
    assert again.record.transitions == 6 and len(again.roadmap) == 5
    assert np.array_equal(again.roadmap.beliefs.tried, first.roadmap.beliefs.tried)
    assert np.array_equal(again.roadmap.beliefs.last, first.roadmap.beliefs.last)
    again.explore()
    assert len(again.roadmap.unexplored) == 0


def test_a_change_that_the_map_refuses_is_not_recorded(tmp_path):
    """It would be refused again at every start."""
    explorer = MapExplorer(square(), BlockedPlant(A, wall(A, B)), store=MapStore(tmp_path / "map.sqlite", "arm"))
    with pytest.raises(mobee.InvalidValue, match="at least one finite pose"):
        explorer.record.change("grow", samples=[[0.5, 0.5]], neighbours=2)
    again = MapExplorer(square(), BlockedPlant(A, wall(A, B)), store=MapStore(tmp_path / "map.sqlite", "arm"))
    assert len(again.roadmap) == 4


def test_a_store_of_another_map_is_refused(tmp_path):
    plant = BlockedPlant(A, wall(A, B))
    Walker(square(), plant, store=MapStore(tmp_path / "map.sqlite", "arm")).go(1)
    with pytest.raises(mobee.MobeeError, match="roadmap"):
        Walker(square(both_ways=True), plant, store=MapStore(tmp_path / "map.sqlite", "arm"))


def test_an_unknown_edge_is_refused():
    with pytest.raises(mobee.InvalidValue, match=r"no edge from 0 to 2: valid are \[1, 3\]"):
        Walker(square(), BlockedPlant(A, wall(A, B))).follow(0, 2)


def test_pushed_off_the_map_it_retraces_its_path_until_it_reaches_a_vertex():
    state = {"blocked": False}

    def blocked(q, target):
        if np.allclose(q, C) and np.allclose(target, D):
            state["blocked"] = True  # from now on neither the goal nor where it set out from can be come to
        return state["blocked"] and (np.allclose(target, C) or np.allclose(target, D))

    plant = BlockedPlant(A, blocked)
    walker = Walker(square(), plant, near=0.05)
    for vertex, goal in ((0, 1), (1, 2), (2, 3)):
        walker.follow(vertex, goal)
    plant.acted.clear()
    assert walker.enter() == 1
    assert np.array_equal(plant.acted, [C, B])


def without_corner_a(plant):
    """A walker that has gone from A over B to C, and then finds that no edge leads to A, which the map loses."""
    walker = Walker(square(), plant, near=0.05)
    walker.go(1)
    walker.go(2)
    for state in (1, 3):
        walker.roadmap.observe(state, walker.roadmap.action(state, 0), state)
    assert walker.record.change("prune", start=2).tolist() == [-1, 0, 1, 2]
    plant.acted.clear()
    return walker


def test_after_pruning_it_knows_where_it_is():
    plant = BlockedPlant(A, lambda q, target: False)
    walker = without_corner_a(plant)
    assert walker.here == 1 and walker.go(0).edges == 1
    assert np.array_equal(plant.acted, [B])


def test_after_pruning_it_retraces_the_part_of_its_path_that_is_left():
    plant = BlockedPlant(A, lambda q, target: False)
    walker = without_corner_a(plant)
    walker.here, plant.q = None, np.array([0.5, 0.9, 0.0])
    assert walker.enter() == 0
    assert np.array_equal(plant.acted, [B])


def test_where_pruning_has_removed_its_vertex_it_goes_to_another_one():
    plant = BlockedPlant(A, lambda q, target: False)
    walker = Walker(square(), plant)
    walker.enter()
    for state in (1, 3):
        walker.roadmap.observe(state, walker.roadmap.action(state, 0), state)
    walker.record.change("prune", start=2)
    assert walker.here is None and walker.enter() == 0
    assert np.array_equal(plant.acted, [B])


def test_an_explorer_still_knows_its_target_after_pruning():
    samples = [[0.5 * k, 0.0, 0.0] for k in range(5)]
    roadmap = mobee.AdaptiveRoadmap(mobee.Space(ROBOT, JOINTS, samples, [[1, -1], [2, -1], [1, 3], [2, 4], [3, -1]]))
    for state, action in roadmap.unexplored[:-1].tolist():
        roadmap.observe(state, action, roadmap.space.goal(state, action))
    explorer = MapExplorer(roadmap, BlockedPlant(samples[1], lambda q, target: False))
    assert not explorer.explore(1) and explorer.here == 2  # on the way to vertex 4
    explorer.record.change("prune", start=2)
    assert len(roadmap) == 4 and explorer.explore() and len(roadmap.unexplored) == 0
