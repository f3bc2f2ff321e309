# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue, UnknownName
from mobee.learning.agent import CuriousAgent
from mobee.learning.discrete import DiscreteSpace
from mobee.learning.runs import GOAL, HAZARDS, NEGLIGIBLE, OTHER, STAY, OutcomeRuns
from mobee.learning.tabular import TabularPlant, ideal
from mobee.learning.transitions import TransitionModel
from mobee.store import TransitionStore
from tests.mobee.learning.toys import arm
from tests.mobee.learning.worlds import space_of

SPACE = arm(neighbours="equidistant")
ALONE = space_of([[1], [0]])  # the only action to state 1, and the one back from it
PRIOR = np.array([STAY, GOAL, OTHER])


def posterior(outcomes: list[int]) -> np.ndarray:
    """The expected counts by summing over all sequences of changes, without recursion over runs: for few outcomes."""
    total, expected = 0.0, np.zeros(3)
    for hazard in HAZARDS:
        for mask in range(2 ** len(outcomes)):
            changes = [bool(mask >> n & 1) for n in range(len(outcomes))]
            weight, counts = 1.0, np.zeros(3)
            for changed, outcome in zip(changes, outcomes, strict=True):
                weight *= hazard if changed else 1.0 - hazard
                counts = np.zeros(3) if changed else counts
                weight *= (counts[outcome] + PRIOR[outcome]) / (counts.sum() + PRIOR.sum())
                counts[outcome] += 1.0
            total, expected = total + weight, expected + weight * counts
    return expected / total


@settings(max_examples=40)
@given(st.lists(st.integers(0, 2), max_size=7))
def test_counts_are_those_expected_over_all_sequences_of_changes(outcomes):
    runs = OutcomeRuns(ALONE)
    for outcome in outcomes:
        runs.observe(0, 0, outcome, 3)
    assert runs.counts(0, 0, 3) == pytest.approx(posterior(outcomes), abs=len(outcomes) ** 2 * NEGLIGIBLE)


def test_a_related_action_is_suspected_once_where_actions_aim_at_their_own_state():
    runs = OutcomeRuns(DiscreteSpace(3, 2))
    for action in 2 * [0, 1, 0, 1, 0, 1]:
        runs.observe(0, action, 0, 3)
    assert runs.observe(0, 0, 2, 3) == [(0, 1)]


def test_what_follows_is_what_an_observation_makes():
    runs = OutcomeRuns(ALONE)
    for outcome in (1, 1, 1, 0, 1):
        expected = runs.following(0, 0, outcome, 2)
        runs.observe(0, 0, outcome, 2)
        assert runs.counts(0, 0, 2) == pytest.approx(expected, abs=0.01)


def test_outcomes_that_stay_the_same_are_kept():
    model = TransitionModel(SPACE, detector="run_length")
    for _ in range(5):
        for state, action in np.argwhere(SPACE.goals >= 0).tolist():
            model.observe(state, action, SPACE.goal(state, action))
    real = (model.counts - model.imagined).clip(0.0).sum()
    assert 0.99 * model.tries.sum() < real <= model.tries.sum() + 1e-6


def changed(detector: str, tries: int = 12) -> TransitionModel:
    """A model of which the actions to state 40 were tried, before one of them fails four times."""
    model = TransitionModel(SPACE, detector=detector)
    for state, action in np.argwhere(SPACE.goals == 40).tolist():
        for _ in range(tries):
            model.observe(state, action, 40)
    state, action = np.argwhere(SPACE.goals == 40)[0].tolist()
    for _ in range(4):
        model.observe(state, action, state)
    return model


def test_outcomes_from_before_a_change_are_forgotten_and_neighbours_become_interesting():
    found, plain = changed("run_length"), changed("none")
    (state, action), *others = np.argwhere(SPACE.goals == 40).tolist()
    stay = [one.debiased().probabilities[state, action, 0] for one in (found, plain)]
    assert stay[0] > 0.8 and stay[1] < 0.3
    for near in map(tuple, others):
        assert found.reward[near] > 3.0 * plain.reward[near]
        assert found.counts[near].sum() < 0.8 * plain.counts[near].sum()
        assert found.tries[near] == plain.tries[near]  # nothing that was observed is lost
    far = tuple(np.argwhere(SPACE.goals == 0)[0])
    assert found.reward[far] == plain.reward[far]


def test_a_neighbour_that_has_not_changed_gets_its_counts_back():
    model = changed("run_length")
    near = tuple(np.argwhere(SPACE.goals == 40)[1].tolist())
    suspect = model.counts[near].sum()
    for _ in range(4):
        model.observe(*near, 40)
    assert model.counts[near].sum() > suspect + 6.0


@pytest.mark.parametrize("divergence", ["kail", "kl", lambda after, before: float(np.abs(after - before).sum())])
def test_the_gain_is_the_reward_of_the_observation(divergence):
    model = TransitionModel(SPACE, divergence=divergence, detector="run_length")
    plain = TransitionModel(SPACE, divergence=divergence)
    rng = np.random.default_rng(0)
    for number in range(60):
        outcome = int(rng.choice([0, SPACE.goal(0, 0), 7, 8]))
        gain = model.gain(0, 0, outcome)
        if number == 0:
            assert gain == pytest.approx(plain.gain(0, 0, outcome))
        assert model.observe(0, 0, outcome) == gain == model.reward[0, 0]
    assert model.probabilities[0, 0].sum() == pytest.approx(1.0)
    assert copy.deepcopy(model).gain(0, 0, 7) == model.gain(0, 0, 7)


def test_a_curious_agent_explores_a_changed_place_again():
    outcomes, chances = ideal(SPACE)
    stuck = np.where(SPACE.goals[:, :, None] == 40, np.arange(81)[:, None, None], outcomes)
    tries = {}
    for detector in ("none", "run_length"):
        agent = CuriousAgent(SPACE, TabularPlant(SPACE, outcomes, chances), detector=detector)
        agent.run(1300)
        agent.plant = TabularPlant(SPACE, stuck, chances, seed=1, start=0)
        agent.interrupt()
        before = agent.model.tries.copy()
        agent.run(200)
        tries[detector] = (agent.model.tries - before)[SPACE.goals == 40].sum()
    assert tries["run_length"] > 1.5 * tries["none"]


@pytest.mark.parametrize("detector", ["none", "run_length"])
def test_a_resumed_agent_has_the_same_beliefs(tmp_path, detector):
    space = space_of([[1, -1], [0, 2], [1, 3], [2, -1]])
    outcomes, chances = ideal(space)
    with TransitionStore(tmp_path / "run.sqlite", space.part) as store:
        agent = CuriousAgent(space, TabularPlant(space, outcomes, chances), store=store, detector=detector)
        agent.run(40)
        agent.plant = TabularPlant(space, np.where(outcomes == 3, 2, outcomes), chances, start=agent.state)
        agent.run(40)
    with TransitionStore(tmp_path / "run.sqlite", space.part) as store:
        again = CuriousAgent(space, TabularPlant(space, outcomes, chances), store=store, detector=detector)
        assert again.model.counts.tolist() == agent.model.counts.tolist()
        assert again.model.reward.tolist() == agent.model.reward.tolist()
        assert ("detector" in again.settings) == (detector != "none")


def test_wrong_detectors_are_refused():
    with pytest.raises(UnknownName, match="Did you mean 'run_length'"):
        TransitionModel(SPACE, detector="run_lenght")
    with pytest.raises(InvalidValue, match="leave forgetting at 1"):
        TransitionModel(SPACE, forgetting=0.9, detector="run_length")
