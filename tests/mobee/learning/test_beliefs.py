from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import value_iteration
from tests.mobee.learning.toys import arm

observations = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3), st.integers(0, 80)), max_size=40)


def of(beliefs, s, a):
    """The probability of each outcome that has one."""
    return {int(o): float(p) for o, p in zip(beliefs.outcomes[s, a], beliefs.probabilities[s, a], strict=True) if p > 0}


def test_an_untried_action_is_expected_to_succeed():
    beliefs = TransitionModel(arm()).debiased()
    assert of(beliefs, 0, 0) == pytest.approx({0: 0.25, beliefs.outcomes[0, 0, 1]: 0.75})


def test_an_action_that_never_failed_is_believed_where_the_counts_doubt_it():
    model = TransitionModel(arm())
    beliefs, goal = model.debiased(), model.space.goal(0, 0)
    for _ in range(10):
        model.observe(0, 0, goal)
    assert of(beliefs, 0, 0)[goal] == pytest.approx(10.3 / 10.4)
    assert of(model, 0, 0)[goal] == pytest.approx(12 / 14)


@given(observations, observations, st.sampled_from(["50-50", "60-40"]), st.sampled_from([1.0, 0.9]))
def test_it_is_the_real_counts_over_the_prior_whenever_it_is_asked_for(before, after, initial, forgetting):
    model = TransitionModel(arm(neighbours="equidistant"), initial, forgetting=forgetting)
    for one in before:
        model.observe(*one)
    beliefs = model.debiased(goal=0.5, stay=0.2)
    for one in after:
        model.observe(*one)
    real: dict[tuple[int, int], dict[int, float]] = {}
    for s, a, outcome in before + after:
        counts = {k: forgetting * v for k, v in real.get((s, a), {}).items()}
        real[s, a] = counts | {outcome: counts.get(outcome, 0.0) + 1.0}
    for (s, a), counts in real.items():
        goal = model.space.goal(s, a)
        weights = counts | {goal: counts.get(goal, 0.0) + 0.5}
        weights |= {s: weights.get(s, 0.0) + 0.2}
        assert of(beliefs, s, a) == pytest.approx({k: v / sum(weights.values()) for k, v in weights.items()})
    assert beliefs.probabilities.sum(axis=-1) == pytest.approx(np.where(model.space.goals == -1, 0.0, 1.0))
    assert np.array_equal(beliefs.outcomes, model.outcomes)


def test_the_same_prior_is_the_same_object_and_others_do_not_mix():
    model = TransitionModel(arm())
    one, other = model.debiased(), model.debiased(goal=1.0, stay=0.0)
    assert model.debiased() is one is not other
    model.observe(0, 0, 40)
    assert of(one, 0, 0)[40] == pytest.approx(1 / 1.4)
    assert of(other, 0, 0) == pytest.approx({40: 0.5, model.space.goal(0, 0): 0.5})


def test_a_plan_with_it_trusts_what_always_succeeded():
    model = TransitionModel(arm(neighbours="equidistant"))
    beliefs, action = model.debiased(), model.space.actions(79).tolist().index(80)
    reward = np.zeros(model.reward.shape)
    reward[80] = 1.0
    for _ in range(20):
        model.observe(79, action, 80)
    trusting, doubting = (q[79, action] / v[80] for v, q in (value_iteration(one, reward) for one in (beliefs, model)))
    assert doubting < trusting < 0.9  # the discount


def test_what_it_shows_cannot_be_written_to():
    beliefs = TransitionModel(arm()).debiased()
    for array in (beliefs.probabilities, beliefs.outcomes):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 0


@pytest.mark.parametrize("prior", [{"goal": 0.0}, {"stay": -0.1}, {"goal": float("nan")}, {"stay": float("inf")}])
def test_a_prior_that_is_none_is_refused(prior):
    with pytest.raises(InvalidValue, match="give counts"):
        TransitionModel(arm()).debiased(**prior)
