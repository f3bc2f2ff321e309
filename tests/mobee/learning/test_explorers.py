# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import copy

import numpy as np
import pytest

from mobee._core import learning as core
from mobee.errors import UnknownName
from mobee.learning.agent import CuriousAgent
from mobee.learning.explorers import Draws, _next_counts, choose, dirichlet
from mobee.learning.tabular import TabularPlant, half_space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import value_iteration
from tests.mobee.learning.toys import InstantPlant, arm
from tests.mobee.learning.worlds import deep_sea, river_swim, space_of


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


def test_draws_at_the_same_count_are_equal():
    first, again = Draws("torso"), Draws("torso")
    wanted = [first.at(3, n).random() for n in range(20)]
    assert [again.at(3, n).random() for n in reversed(range(20))] == wanted[::-1]


def test_nothing_is_left_of_the_draws_before():
    draws = Draws("torso")
    wanted = draws.at(0, 7).random(3).tolist()
    draws.at(0, 6).integers(5, dtype=np.int32)  # leaves half a word behind
    assert draws.at(0, 7).random(3).tolist() == wanted


def test_draws_differ_by_seed_name_and_count():
    drawn = {Draws(name).at(seed, n).random() for seed in (-1, 0, 1, 11) for name in ("torso", "left_arm") for n in (0, 1, 10)}
    assert len(drawn) == 24


def test_first_draws_are_uniform_over_counts():
    draws = Draws("left_arm")
    counts, _ = np.histogram([draws.at(3, n).random() for n in range(4000)], bins=10, range=(0, 1))
    assert ((counts - 400) ** 2 / 400).sum() < 27.9  # chi square of 9 degrees of freedom, one in a thousand


def test_draws_are_those_of_a_generator_that_was_set_at_once():
    draws = Draws("torso")
    bits = np.random.PCG64(0)
    for count in range(3):
        given, wanted = draws.at(5, count), np.random.Generator(bits)
        bits.state = given.bit_generator.state
        assert (given.random(), given.integers(9), given.normal()) == (wanted.random(), wanted.integers(9), wanted.normal())
    assert isinstance(draws.at(0, 0), np.random.Generator)


def test_a_copy_draws_the_same_and_leaves_the_original_alone():
    draws = Draws("torso")
    first = draws.at(1, 1)
    again = copy.deepcopy(draws).at(1, 1).random()
    assert first.random() == again


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


def test_of_two_paths_to_untried_actions_it_takes_the_one_to_more_of_them():
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


def test_drawn_probabilities_have_the_mean_and_spread_of_the_dirichlet_distribution():
    counts = np.array([2.0, 3.0, 1.0, 0.0])
    drawn = dirichlet(np.tile(counts, (200_000, 1)), np.random.default_rng(0).standard_normal((200_000, 4)))
    total = counts.sum()
    assert drawn.sum(axis=-1) == pytest.approx(1.0)
    assert (drawn[:, 3] == 0.0).all()
    assert drawn.mean(axis=0) == pytest.approx(counts / total, abs=0.01)
    assert drawn.var(axis=0) == pytest.approx(counts * (total - counts) / total**2 / (total + 1.0), abs=0.003)


def test_where_there_is_no_action_there_is_no_probability():
    assert not dirichlet(np.zeros((2, 3)), np.ones((2, 3))).any()


def beliefs_of(agent, monkeypatch):
    """The probabilities that the agent's next decision is made with."""
    seen = []
    plan = agent.plan
    monkeypatch.setattr(agent, "plan", lambda *asked, **key: seen.append(asked[1].probabilities) or plan(*asked, **key))
    agent.decide(agent.state)
    monkeypatch.undo()
    return seen[0]


def test_a_world_is_held_for_an_episode_and_then_drawn_anew(monkeypatch):
    space = arm(neighbours="equidistant")
    agent = CuriousAgent(space, InstantPlant(space.robot), "posterior_sampling")
    before = [beliefs_of(agent, monkeypatch)]
    for _ in range(10):
        agent.step()
        before.append(beliefs_of(agent, monkeypatch))
    same = [(after == first).all(axis=-1).mean() for first, after in zip(before, before[1:], strict=False)]
    assert min(same[:9]) > 0.99  # all but the state-action just observed
    assert same[9] < 0.5


def test_an_outcome_never_seen_before_changes_its_own_state_action_alone(monkeypatch):
    space = arm(neighbours="equidistant")
    agent = CuriousAgent(space, InstantPlant(space.robot), "posterior_sampling")
    before = beliefs_of(agent, monkeypatch)
    agent.model.observe(5, 0, 80)
    after = beliefs_of(agent, monkeypatch)
    changed = (after[:, :, :2] != before).any(axis=-1)
    assert np.argwhere(changed).tolist() == [[5, 0]]
    assert after[5, 0, 2] > 0
