# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import heapq

import numpy as np
import pytest

from experiments.claims.ch7_learning.exploration_coverage import (
    CLAIMS,
    aggressive,
    best,
    depletes,
    first_repeat,
    half,
    near_floor,
    novel,
    row,
    shortest_walk,
    states_seen,
    trial,
)
from experiments.kit.experiment import judged
from experiments.kit.learning.arm import HYPERCUBE, RANK3, RANK4, arm_space
from mobee.errors import InvalidValue


def values(end: float, floor: int = 100, repeats_at: int = 50):
    new = np.concatenate([np.arange(1, repeats_at), [end]]).astype(int)
    return {
        "new_actions": new,
        "new_states": np.arange(81) * 2,
        "state_actions": len(new),
        "floor": floor,
        "failed": 0.0,
        "transitions": end,
    }


def published(curious: int, least: int):
    runs = {"curious": (curious, 900), "least_tried": (least, 400), "random": (9 * curious, 30)}
    return {
        (world, name): [values(end + seed, floor=1550, repeats_at=repeat) for seed in range(10)]
        for world in ("constrained", "free")
        for name, (end, repeat) in runs.items()
    }


def verdicts(runs) -> dict[str, str]:
    return {claim["text"]: claim["verdict"] for claim in judged(CLAIMS, runs)}


def test_the_first_repeat_and_the_states_seen_follow_from_the_new_actions_and_states():
    one = values(99.0, repeats_at=50)
    assert first_repeat(one) == 50 and states_seen(one, 20) == 11


def test_runs_in_which_not_every_action_was_tried_are_counted():
    one = values(99.0)
    found = row([one, one | {"transitions": 5000, "state_actions": 51}])
    assert found["unfinished"] == 1 and found["high"] == 5000


@pytest.mark.parametrize(
    ("curious", "least", "expected"),
    [(1590, 3200, ("confirmed", "met")), (3000, 3200, ("not reproduced", "not met")), (1590, 9000, ("stronger", "met"))],
)
def test_the_ratio_and_the_shortest_walk_decide(curious, least, expected):
    found = verdicts(published(curious, least))
    assert {found[claim.text] for claim in half.values()} == {expected[0]}
    assert {found[claim.text] for claim in near_floor.values()} == {expected[1]}


def test_a_ratio_that_is_published_at_one_discount_alone_depends_on_it():
    runs = published(1590, 3200)
    runs |= {(world, "curious 0.5"): runs[world, "least_tried"] for world in ("constrained", "free")}
    assert {verdicts(runs)[claim.text] for claim in half.values()} == {"depends"}


def test_runs_as_published_confirm_the_claims_about_new_actions_but_not_that_about_new_states():
    found = verdicts(published(1590, 3200))
    assert [found[claim.text] for claim in (best, novel, aggressive)] == ["confirmed", "confirmed", "not reproduced"]


def test_the_depleting_explorer_is_judged_only_with_runs_in_both_worlds():
    runs = published(1590, 3200)
    runs |= {(world, name): runs[world, "curious"] for world in ("constrained", "free") for name in ("depleting", "nearest_untried")}
    assert verdicts(runs)[depletes.text] == "met"
    del runs["free", "nearest_untried"]
    assert verdicts(runs)[depletes.text] == "open"


def searched_walk(goals: np.ndarray) -> int:
    """The length of the shortest walk, by searching all walks."""
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
def test_the_shortest_walk_is_that_of_a_search(seed):
    rng = np.random.default_rng(seed)
    states = 4
    ring = (np.arange(states) + 1) % states
    goals = np.full((states, 3), -1)
    goals[:, 0] = ring  # so that every state can be reached
    for state in range(states):
        for action in range(1, 3):
            if rng.random() < 0.6:
                goals[state, action] = rng.integers(states)
    assert shortest_walk(goals) == searched_walk(goals)


@pytest.mark.parametrize(("levels", "actions"), [(HYPERCUBE, 64), (RANK3, 432), (RANK4, 1536)])
def test_with_equidistant_neighbours_the_shortest_walk_repeats_no_action(levels, actions):
    assert shortest_walk(arm_space(levels).goals) == actions


def test_a_curious_agent_on_the_real_lattice_is_close_to_the_shortest_walk():
    found = trial({"graph": "equidistant", "world": "free", "explorer": "curious", "discount": 0.9}, 0)
    assert len(found["new_actions"]) == found["state_actions"] == 432 == found["floor"]
    assert found["new_actions"][-1] == found["transitions"] <= 1.2 * 432
    assert found["failed"] == 0.0 and len(found["new_states"]) == 81


def test_a_graph_that_is_not_connected_has_no_walk():
    with pytest.raises(InvalidValue, match="cannot be reached"):
        shortest_walk(np.array([[1], [1]]))
