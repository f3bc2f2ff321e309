from __future__ import annotations

import heapq

import numpy as np
import pytest

from experiments.coverage.postman import postman_floor
from experiments.kit.arm_learning import HYPERCUBE, RANK3, RANK4, arm_space
from mobee.errors import InvalidValue


def shortest_walk(goals: np.ndarray) -> int:
    """By trying all walks, nearest first."""
    arcs = [(int(s), int(goals[s, a])) for s, a in zip(*np.nonzero(goals >= 0), strict=True)]
    everything = (1 << len(arcs)) - 1
    queue = [(0, start, 0) for start in range(len(goals))]
    seen = set()
    while queue:
        steps, at, tried = heapq.heappop(queue)
        if tried == everything:
            return steps
        if (at, tried) in seen:
            continue
        seen.add((at, tried))
        for i, (source, goal) in enumerate(arcs):
            if source == at:
                heapq.heappush(queue, (steps + 1, goal, tried | 1 << i))
    raise AssertionError("no walk")


@pytest.mark.parametrize("seed", range(12))
def test_the_floor_is_the_shortest_of_all_walks(seed):
    rng = np.random.default_rng(seed)
    states = 4
    ring = (np.arange(states) + 1) % states
    goals = np.full((states, 3), -1)
    goals[:, 0] = ring  # so that every state can be reached
    for state in range(states):
        for action in range(1, 3):
            if rng.random() < 0.6:
                goals[state, action] = rng.integers(states)
    assert postman_floor(goals) == shortest_walk(goals)


@pytest.mark.parametrize(("levels", "actions"), [(HYPERCUBE, 64), (RANK3, 432), (RANK4, 1536)])
def test_equidistant_neighbours_need_no_detour(levels, actions):
    assert postman_floor(arm_space(levels).goals) == actions


def test_the_nearest_neighbours_need_about_a_fifth_more():
    floors = [postman_floor(arm_space(neighbours=16, tie_seed=seed).goals) for seed in range(5)]
    assert all(1500 <= floor <= 1620 for floor in floors)  # 1550 in the median of a reference implementation


def test_a_space_that_falls_apart_has_no_walk():
    with pytest.raises(InvalidValue, match="cannot be reached"):
        postman_floor(np.array([[1], [1]]))
