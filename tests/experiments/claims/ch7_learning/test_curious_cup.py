# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from experiments.claims.ch7_learning.curious_cup import AGENTS, CLAIMS, CUP, MAIN, RANDOM, REPLAYED, STILL, moves, trial
from experiments.kit.experiment import judged
from experiments.kit.learning.pushing import ARRANGEMENTS


def test_the_cells_to_push_to_are_those_that_the_hand_can_push_to() -> None:
    assert ARRANGEMENTS[MAIN].goals == [0, 1, 3, 6, 7]
    assert len(ARRANGEMENTS["twelve cells"].goals) == 7


def test_the_same_seed_moves_the_same_cup_whatever_the_agent_perceives_until_it_decides_otherwise() -> None:
    settings = {"arrangement": MAIN, "transitions": 40, "tries": 2}
    found = {agent: trial(settings | {"agent": agent}, 3) for agent in AGENTS}
    assert all(len(one["moved"]) == 40 and len(one["reached"]) == 2 for one in found.values())
    assert all((one["moved"] | ~one["fell"]).all() for one in found.values())
    assert {agent for agent, one in found.items() if "by_chance" in one} == {RANDOM}
    first = int(found[CUP]["moved"].argmax()) + 1  # up to the first move the place is the same: so are the decisions
    assert np.array_equal(found[CUP]["moved"][:first], found[STILL]["moved"][:first])


def runs(often: dict[str, float], reached: dict[str, float]) -> dict[str, list[dict[str, np.ndarray]]]:
    """Five equal runs of each agent."""
    return {
        agent: [{"moved": np.arange(1000) < often[agent], "reached": np.array([reached[agent]]), "by_chance": np.array([0.2])}] * 5
        for agent in AGENTS
    }


def test_claims_compare_with_every_control() -> None:
    often, reached = dict.fromkeys(AGENTS, 100.0) | {CUP: 300.0}, dict.fromkeys(AGENTS, 0.3) | {CUP: 0.8}
    assert moves(runs(often, reached)[CUP][0]) == 300.0
    verdicts = [
        [claim["verdict"] for claim in judged(CLAIMS, runs(*given))]
        for given in ((often, reached), (often | {STILL: 400.0}, reached), (often, reached | {REPLAYED: 0.9}))
    ]
    assert verdicts == [["met", "met"], ["not met", "met"], ["met", "not met"]]
