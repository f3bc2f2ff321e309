from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import UnknownName
from mobee.learning.agent import CuriousAgent
from mobee.learning.explorers import choose
from tests.mobee.learning.toys import InstantPlant, arm


def agent(explorer, space=None, seed=0):
    space = space or arm(neighbours="equidistant")
    return CuriousAgent(space, InstantPlant(space.robot), explorer, seed)


def decisions(made_by, state, count=200):
    """What agents of many seeds decide in the same situation."""
    chosen = []
    for seed in range(count):
        made_by.seed = seed
        chosen.append(made_by.decide(state))
    return np.bincount(chosen, minlength=len(made_by.space.actions(state)))


def test_ties_are_drawn_uniformly():
    rng = np.random.default_rng(0)
    drawn = np.bincount([choose(np.array([1.0, 0.0, 1.0 - 1e-13, 1.0 - 1e-11]), rng) for _ in range(2000)], minlength=4)
    assert drawn[1] == drawn[3] == 0
    assert 900 < drawn[0] < 1100


def test_curiosity_prefers_the_untried():
    one = agent("curious")
    for a in (0, 1, 3):
        one.model.observe(0, a, one.space.goal(0, a))
    assert decisions(one, 0).tolist() == [0, 0, 200, 0]


def test_curiosity_goes_where_the_untried_is():
    one = agent("curious")
    for s in range(81):
        if s != 80:
            for a, goal in enumerate(one.space.actions(s)):
                for _ in range(15):
                    one.model.observe(s, a, goal)
    assert one.space.goal(0, int(decisions(one, 0).argmax())) > 0
    state = 0
    for _ in range(8):  # corner to corner of the lattice
        state = one.space.goal(state, one.decide(state))
    assert state == 80


def test_least_tried_prefers_the_least_tried_here_wherever_it_leads():
    one = agent("least_tried")
    for a, times in ((0, 1), (1, 2), (2, 1), (3, 2)):
        for _ in range(times):
            one.model.observe(0, a, 5)
    chosen = decisions(one, 0)
    assert chosen[1] == chosen[3] == 0
    assert chosen[0] > 60 and chosen[2] > 60


def test_random_ignores_what_was_learnt():
    one = agent("random")
    for _ in range(20):
        one.model.observe(0, 1, 0)
    assert decisions(one, 0, 400).min() > 60


def test_only_curiosity_plans(monkeypatch):
    def no_plan(*_, **__):
        raise AssertionError("planned")

    monkeypatch.setattr("mobee.learning.plans.value_iteration", no_plan)
    agent("random").step()
    agent("least_tried").step()
    with pytest.raises(AssertionError, match="planned"):
        agent("curious").step()


def test_an_unknown_explorer_is_refused_with_the_nearest_name():
    with pytest.raises(UnknownName, match="Did you mean 'curious'"):
        agent("curiuos")
