from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import UnknownName
from mobee.learning.agent import CuriousAgent
from mobee.learning.explorers import choose
from mobee.learning.tabular import TabularPlant, half_space
from tests.mobee.learning.toys import InstantPlant, arm
from tests.mobee.learning.worlds import deep_sea, river_swim


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

    monkeypatch.setattr("mobee.learning.learner.value_iteration", no_plan)
    agent("random").step()
    agent("least_tried").step()
    with pytest.raises(AssertionError, match="planned"):
        agent("curious").step()


def test_an_unknown_explorer_is_refused_with_the_nearest_name():
    with pytest.raises(UnknownName, match="Did you mean 'curious'"):
        agent("curiuos")


def test_nearest_untried_goes_straight_to_the_only_untried_state_action():
    one = agent("nearest_untried")
    for s in range(81):
        for a, goal in enumerate(one.space.actions(s)):
            if (s, a) != (80, 0):
                one.model.observe(s, a, goal)
    state, steps = 0, 0
    while state != 80:
        state, steps = one.space.goal(state, one.decide(state)), steps + 1
    assert steps == 8
    assert one.decide(80) == 0


def test_when_all_is_tried_nearest_untried_goes_for_the_least_tried():
    one = agent("nearest_untried")
    for s in range(81):
        for a, goal in enumerate(one.space.actions(s)):
            for _ in range(1 if (s, a) == (3, 1) else 2):
                one.model.observe(s, a, goal)
    assert decisions(one, 3, 20).tolist() == [0, 20, 0, 0, 0]


def test_a_count_bonus_prefers_few_tries_however_dull():
    one = agent("count_bonus")
    for s in range(81):
        for a, goal in enumerate(one.space.actions(s)):
            for n in range(3 if (s, a) == (0, 2) else 5):
                one.model.observe(s, a, goal if s or a == 2 else (80 + 7 * n) % 81)
    assert one.model.reward[0].argmax() != 2
    assert decisions(one, 0, 20).tolist() == [0, 0, 20, 0]


def tried_all_after(plant, explorer, seed, most=2000):
    """How many transitions until every state-action was tried."""
    one = CuriousAgent(plant.space, plant, explorer, seed)
    exists = plant.space.goals >= 0
    while one.transitions < most and (one.model.tries[exists] == 0).any():
        one.step()
    return one.transitions


@pytest.mark.parametrize(
    ("world", "explorer", "most"),
    [
        (lambda seed: river_swim(6, seed), "curious", 40),
        (lambda seed: river_swim(6, seed), "nearest_untried", 40),
        (lambda seed: river_swim(6, seed), "depleting", 40),
        (lambda seed: river_swim(20, seed), "curious", 250),
        (lambda seed: river_swim(20, seed), "nearest_untried", 250),
        (lambda seed: river_swim(20, seed), "depleting", 250),
        (lambda seed: deep_sea(10, seed), "curious", 330),
        (lambda seed: deep_sea(10, seed), "nearest_untried", 200),
        (lambda seed: deep_sea(10, seed), "depleting", 280),
    ],
)
def test_explorers_that_plan_try_all_of_worlds_that_are_hard_to_explore(world, explorer, most):
    assert np.median([tried_all_after(world(seed), explorer, seed) for seed in range(7)]) <= most


@pytest.mark.parametrize("explorer", ["random", "least_tried"])
def test_explorers_that_do_not_plan_fail_there(explorer):
    assert tried_all_after(river_swim(20), explorer, 0) == 2000
    assert tried_all_after(deep_sea(10), explorer, 0) == 2000


def error_where_it_is_uncertain(explorer, seed):
    """L1 between debiased beliefs and truth after 4000 transitions, mean over the state-actions with more than one outcome."""
    space = arm(neighbours="equidistant")
    plant = TabularPlant(space, *half_space(space), seed=seed)
    one = CuriousAgent(space, plant, explorer, seed)
    one.run(4000)
    found = []
    for s, a in np.argwhere((plant.probabilities > 0.01).sum(axis=-1) > 1):
        off = np.zeros(81)
        for model, sign in ((plant, 1.0), (one.model.debiased(), -1.0)):
            np.add.at(off, model.outcomes[s, a], sign * model.probabilities[s, a])
        found.append(np.abs(off).sum())
    return np.mean(found)


def test_depleting_learns_uncertain_actions_at_least_1_6_times_better_than_least_tried():
    least_tried, depleting = (
        np.mean([error_where_it_is_uncertain(name, seed) for seed in range(3)]) for name in ("least_tried", "depleting")
    )
    assert least_tried >= 1.6 * depleting
