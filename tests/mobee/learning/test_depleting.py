from __future__ import annotations

import copy

import numpy as np
import pytest

from mobee._core import learning as core
from mobee.learning.agent import CuriousAgent
from mobee.learning.explorers import _next_counts
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import value_iteration
from tests.mobee.learning.toys import InstantPlant, arm
from tests.mobee.learning.worlds import space_of

SETTINGS = ({}, {"initial": "60-40"}, {"divergence": "kl"}, {"forgetting": 0.8}, {"forgetting": 0.8, "divergence": "kl"})


def experienced(settings, transitions=3000):
    model = TransitionModel(arm(neighbours="equidistant"), **settings)
    rng = np.random.default_rng(0)
    for _ in range(transitions):
        s = int(rng.integers(20))
        a = int(rng.integers(len(model.space.actions(s))))
        model.observe(s, a, int(rng.choice([s, model.space.goal(s, a), 80], p=[0.2, 0.7, 0.1])))
    return model


def expected(model, state, action):
    """The oracle: what each outcome would pay, weighted by how probable it is believed to be."""
    beliefs = model.debiased()
    pairs = zip(beliefs.probabilities[state, action], beliefs.outcomes[state, action], strict=True)
    return sum(p * model.gain(state, action, int(outcome)) for p, outcome in pairs if p > 0)


def expected_gains(model):
    gains = model.reward.copy()
    core.expected_gains(model.debiased().table, *_next_counts(model), model.tries, gains)
    return gains


@pytest.mark.parametrize("settings", SETTINGS)
def test_gains_to_expect_are_those_that_the_outcomes_would_pay(settings):
    model = experienced(settings)
    gains = expected_gains(model)
    for s, a in np.argwhere(model.tries > 0):
        assert gains[s, a] == pytest.approx(expected(model, s, a), abs=1e-14)
    assert (model.tries == 0).any()
    assert np.array_equal(gains[model.tries == 0], model.reward[model.tries == 0])


@pytest.mark.parametrize("settings", SETTINGS[:3])
def test_gains_along_a_plan_fall_as_if_its_most_likely_outcomes_were_observed(settings):
    model = experienced(settings)
    beliefs, gains = model.debiased(), expected_gains(model)
    _, q = value_iteration(beliefs, gains)
    left = gains.copy()
    core.deplete(beliefs.table, *_next_counts(model), q, 3, 25, left)
    later, state, met = copy.deepcopy(model), 3, set()
    for _ in range(25):
        action = int(q[state].argmax())
        outcome = int(beliefs.outcomes[state, action, beliefs.probabilities[state, action].argmax()])
        met.add((state, action))
        later.observe(state, action, outcome)
        state = outcome
    for s, a in np.argwhere(model.reward != -np.inf):
        if (s, a) not in met:
            assert left[s, a] == gains[s, a]
            continue
        p, now = beliefs.probabilities[s, a], beliefs.outcomes[s, a]
        falls_to = sum(x * later.gain(s, a, int(o)) for x, o in zip(p, now, strict=True) if x > 0)
        assert left[s, a] == pytest.approx(min(gains[s, a], falls_to), abs=1e-14)


def test_of_two_ways_to_the_untried_it_takes_the_one_to_more_of_it():
    """From 0 to 1 or 2; both have one action back and four onward, of which 1 has tried three and 2 none."""
    space = space_of([[1, 2, -1, -1, -1]] + [[0, 3, 4, 5, 6]] * 2 + [[0, -1, -1, -1, -1]] * 4)
    agent = CuriousAgent(space, InstantPlant(space.robot), "depleting")
    tried = [(0, 0), (0, 1), (1, 0), (2, 0), (1, 1), (1, 2), (1, 3), (3, 0), (4, 0), (5, 0), (6, 0)]
    for s, a in tried:
        for _ in range(20):
            agent.model.observe(s, a, space.goal(s, a))
    curious = agent.plan(expected_gains(agent.model), key="")[1][0]
    assert curious[0] == pytest.approx(curious[1], rel=1e-3)
    assert agent.decide(0) == 1
