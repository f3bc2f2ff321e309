# SPDX-License-Identifier: Apache-2.0
"""Algorithms 6 and 7 to the letter: the printed tables, and that the transition model and the planner do the same."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import value_iteration
from mobee.reference import learning as reference
from tests.mobee.learning.tables import chain, random_problem
from tests.mobee.learning.toys import arm

PRINTED = 5e-5  # nats
OBSERVED = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 1), st.sampled_from([0, 1, 3, 9, 40])), max_size=40)
SPACE = arm(neighbours="equidistant")


def imagined(state: int, action: int, initial: str = "50-50") -> tuple[reference.Bins, float]:
    return reference.imagined(state, SPACE.goal(state, action), initial)


@pytest.mark.parametrize(
    ("initial", "counts", "printed"), [("50-50", [2.0, 2.0], 0.0589), ("60-40", [2.0, 3.0], 0.0201)], ids=["table 6.1", "table 7.1"]
)
def test_an_action_is_imagined_as_printed(initial: str, counts: list[float], printed: float) -> None:
    bins, reward = reference.imagined(7, 3, initial)
    assert list(bins) == [7, 3] and list(bins.values()) == counts
    assert reward == pytest.approx(printed, abs=PRINTED)


@pytest.mark.parametrize(
    ("outcomes", "printed"),
    [((1, 1, 1), (0.0201, 0.0095, 0.0052)), ((5, 5, 5), (0.0487, 0.0196, 0.0103))],
    ids=["table 6.2", "table 6.3"],
)
def test_rewards_fall_as_printed(outcomes: tuple[int, ...], printed: tuple[float, ...]) -> None:
    bins, _ = reference.imagined(0, 1)
    for outcome, expected in zip(outcomes, printed, strict=True):
        bins, reward = reference.observe(bins, outcome)
        assert reward == pytest.approx(expected, abs=PRINTED)
    assert sum(reference.probabilities(bins).values()) == pytest.approx(1.0)


@given(OBSERVED, st.sampled_from(["50-50", "60-40"]), st.sampled_from([1.0, 0.9, 0.5]))
def test_the_transition_model_counts_and_pays_this(observed: list[tuple[int, int, int]], initial: str, forgetting: float) -> None:
    """Counts are whole numbers and exact where nothing is forgotten; the reward is a closed form of the same sum."""
    model = TransitionModel(SPACE, initial, forgetting=forgetting)
    known: dict[tuple[int, int], reference.Bins] = {}
    for s, a, outcome in observed:
        floor = imagined(s, a, initial)[0]
        bins = reference.forget(known.get((s, a), floor), floor, forgetting)
        known[s, a], reward = reference.observe(bins, outcome)
        assert model.observe(s, a, outcome) == pytest.approx(reward, abs=1e-12)
        assert model.reward[s, a] == pytest.approx(reward, abs=1e-12)
        states, counts = model.bins(s, a)
        assert states.tolist() == list(known[s, a])
        assert counts == pytest.approx(np.array(list(known[s, a].values())), rel=0.0 if forgetting == 1.0 else 1e-12)
        believed = list(reference.probabilities(known[s, a]).values())
        assert model.probabilities[s, a, : len(believed)] == pytest.approx(believed, abs=1e-15)
    assert model.tries.sum() == len(observed)
    untried = next((s, a) for s in range(6) for a in range(3) if (s, a) not in known)
    assert model.reward[untried] == pytest.approx(imagined(*untried, initial)[1], abs=1e-15)


@given(OBSERVED, st.sampled_from([1.0, 0.9, 0.5]))
def test_plain_kl_pays_this(observed: list[tuple[int, int, int]], forgetting: float) -> None:
    model = TransitionModel(SPACE, divergence="kl", forgetting=forgetting)
    counts = np.ones((6, 2, len(SPACE)))
    for s, a, outcome in observed:
        counts[s, a], reward = reference.observe_among_all(1.0 + forgetting * (counts[s, a] - 1.0), outcome)
        assert model.observe(s, a, outcome) == pytest.approx(reward, abs=1e-12)
        assert model.totals[s, a] == pytest.approx(counts[s, a].sum())


@pytest.mark.parametrize("seed", range(40))
def test_values_of_random_problems_are_those_of_algorithm_7(seed: int) -> None:
    """Sums over outcomes in another order; the sweeps end at the same one, for no change comes so near to the tolerance."""
    model, reward, discount = random_problem(seed)
    start = np.random.default_rng(seed).normal(size=len(reward))
    for begin in (None, start):
        values, of_actions = value_iteration(model, reward, discount, 1e-4, begin)
        expected, of_each = reference.value_iteration(model.outcomes, model.probabilities, reward, discount, 1e-4, begin)
        size = max(1.0, np.abs(expected).max())
        exists = np.isfinite(of_each)
        assert np.array_equal(np.isfinite(of_actions), exists)
        assert np.abs(values - expected).max() < 1e-12 * size
        assert np.abs(of_actions[exists] - of_each[exists]).max(initial=0.0) < 1e-12 * size


def test_the_plan_of_a_curious_agent_is_that_of_algorithm_7(rng: np.random.Generator) -> None:
    model = TransitionModel(arm(neighbours=16))
    for _ in range(400):
        s = int(rng.integers(81))
        model.observe(s, int(rng.integers(len(model.space.actions(s)))), int(rng.integers(81)))
    expected, of_each = reference.value_iteration(model.outcomes, model.probabilities, model.reward)
    values, of_actions = value_iteration(model, model.reward)
    assert values == pytest.approx(expected, abs=1e-14)
    assert of_actions == pytest.approx(of_each, abs=1e-14)
    quicker, _ = value_iteration(model, model.reward, tolerance=1e-12, method="modified")
    assert quicker == pytest.approx(reference.value_iteration(*tables(model), tolerance=1e-12)[0], abs=1e-10)


def tables(model: TransitionModel) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return model.outcomes, model.probabilities, model.reward


def test_values_may_fall_and_a_state_without_actions_keeps_its_value() -> None:
    model, reward = chain()
    values, _ = reference.value_iteration(model.outcomes, model.probabilities, reward)
    assert values == pytest.approx([-4.0951, -3.439, -2.71, -1.9, -1.0, 0.0], abs=1e-9)
    reward[5] = -np.inf
    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 7.0])
    kept, of_actions = reference.value_iteration(model.outcomes, model.probabilities, reward, 0.9, 1e-12, start)
    assert kept[5] == 7.0 and of_actions[5, 0] == -np.inf
    assert kept[4] == pytest.approx(-1.0 + 0.9 * 7.0)
