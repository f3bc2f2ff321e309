from __future__ import annotations

import numpy as np

from experiments.reaching.looks import learn
from experiments.reaching.scene import MARKER, reach_space
from experiments.reaching.targets import between, grid, targets_at
from mobee.learning.reaching.reach_agent import ReachAgent
from tests.experiments.reaching.test_truth import ExactPlant


def test_what_was_done_is_counted_by_the_numbers_of_the_given_problems():
    space, problems = reach_space(), targets_at(grid())
    agent = ReachAgent(space, ExactPlant(space), marker=MARKER, strategy="random", seed=2)
    sets = {"grid": problems, "between": targets_at(between())}
    values = learn(agent, problems, [10, 54], 1, sets)
    assert np.bincount(values["problem"]).tolist() == [2] * 27
    assert values["rewards_grid"].shape == (2, 1, 27) and values["states_between"].shape == (2, 1, 8)
    reached = values["reach_state"] >= 0
    assert np.allclose(values["reward"][reached], 1.0 / (1.0 + values["reach_state"][reached]))
    assert (values["actions"][reached] >= 1).all() and (values["actions"] <= agent.limit).all()
    assert values["failures"].sum() == 0 and values["duration"].min() >= 2.0
