# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue, UnknownName
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel, information_gain, kl_divergence
from mobee.learning.value_iteration import value_iteration
from mobee.reference.learning import imagined, observe
from tests.mobee.learning.toys import arm, torso

PRINTED = 5e-5


S, ACTION, GOAL = 0, 0, 1  # the first action of state 0 aims at state 1


OTHERS = (5, 6, 7)


def rewards(observations: list[int], initial: str = "50-50") -> list[float]:
    model = TransitionModel(arm(neighbours="equidistant"), initial)
    assert model.space.goal(S, ACTION) == GOAL
    return [model.reward[S, ACTION]] + [model.observe(S, ACTION, s) for s in observations]


def test_a_predictable_action_that_succeeds_bores_as_in_table_6_2():
    assert rewards([GOAL] * 3) == pytest.approx([0.0589, 0.0201, 0.0095, 0.0052], abs=PRINTED)


def test_a_predictable_action_that_surprises_stays_interesting_as_in_table_6_3():
    assert rewards([OTHERS[0]] * 3) == pytest.approx([0.0589, 0.0487, 0.0196, 0.0103], abs=PRINTED)


TABLE_6_4 = [*OTHERS, GOAL, *OTHERS[:2]]


def test_an_unpredictable_action_by_algorithm_6():
    assert rewards(TABLE_6_4) == pytest.approx([0.0589, 0.0487, 0.0398, 0.0333, 0.0153, 0.0144, 0.0135], abs=PRINTED)


def test_table_6_4_as_printed_is_the_reverse_divergence_from_its_third_row_on():
    # Erratum: KL(T || P) instead of eq. 6.5's KL(P || T).
    bins, reverse = imagined(S, GOAL)[0], []
    for outcome in TABLE_6_4:
        bins, _ = observe(bins, outcome)
        before = bins | {outcome: bins[outcome] - 1.0}
        reverse.append(kl_divergence(list(before.values()), list(bins.values())))
    assert reverse[1:] == pytest.approx([0.0345, 0.0283, 0.0142, 0.0133, 0.0125], abs=PRINTED)
    assert reverse[0] != pytest.approx(0.0487, abs=PRINTED)


def test_success_decays_below_a_thousandth_after_eight_tries():
    decay = rewards([GOAL] * 19)
    assert decay[1:9] == pytest.approx([0.0201, 0.0095, 0.0052, 0.0032, 0.0021, 0.0015, 0.0011, 0.0008], abs=PRINTED)
    assert decay[7] > 1e-3 > decay[8]
    assert decay[19] < 1e-4


def test_60_40_makes_failure_more_interesting_than_success():
    initial, success = rewards([GOAL], "60-40")
    failure = rewards([S], "60-40")[1]
    assert initial == pytest.approx(0.0201, abs=PRINTED)
    assert failure > success
    model = TransitionModel(arm(), "60-40")
    assert np.allclose(model.probabilities, [0.4, 0.6])


def test_bins_keep_the_order_of_first_observation():
    model = TransitionModel(arm(neighbours="equidistant"))
    for s in (7, 5, 7, GOAL):
        model.observe(S, ACTION, s)
    states, counts = model.bins(S, ACTION)
    assert states.tolist() == [S, GOAL, 7, 5]
    assert counts.tolist() == [2, 3, 3, 2]
    assert model.probabilities[S, ACTION] == pytest.approx(np.array([2, 3, 3, 2]) / 10)


def test_reward_has_no_finite_entry_where_there_is_no_action():
    space = arm(neighbours="equidistant")
    model = TransitionModel(space)
    assert model.reward.shape == (81, 8)
    assert np.array_equal(model.reward == -np.inf, space.goals == -1)
    assert np.array_equal(model.probabilities.sum(axis=-1), np.where(space.goals == -1, 0.0, 1.0))


def test_what_the_model_shows_cannot_be_written_to():
    model = TransitionModel(arm())
    for array in (model.reward, model.tries, model.outcomes):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 0


def test_tries_count_real_observations_only():
    model = TransitionModel(arm())
    assert model.tries.sum() == 0
    model.observe(3, 2, 9)
    model.observe(3, 2, 9)
    assert model.tries[3, 2] == model.tries.sum() == 2


@given(st.lists(st.tuples(st.integers(0, 80), st.integers(0, 3), st.integers(0, 80)), max_size=60))
def test_probabilities_follow_the_counts_and_gain_foretells_the_reward(observations):
    model = TransitionModel(arm(neighbours="equidistant"))
    reference: dict[tuple[int, int], dict[int, int]] = {}
    for s, a, outcome in observations:
        bins = reference.setdefault((s, a), {s: 2, model.space.goal(s, a): 2})
        bins[outcome] = bins.get(outcome, 1) + 1
        foretold = model.gain(s, a, outcome)
        assert model.observe(s, a, outcome) == foretold == model.reward[s, a] > 0
    for (s, a), expected in reference.items():
        states, counts = model.bins(s, a)
        assert dict(zip(states.tolist(), counts.tolist(), strict=True)) == expected
    assert model.probabilities.sum(axis=-1)[model.space.goals != -1] == pytest.approx(1.0)
    assert np.array_equal(model.totals, model.counts.sum(axis=-1))
    assert model.tries.sum() == len(observations)


def test_gain_changes_nothing():
    model = TransitionModel(arm())
    model.gain(0, 0, 40)
    assert model.tries.sum() == 0 and len(model.bins(0, 0)[0]) == 2


def test_unknown_states_actions_and_initialisations_are_refused():
    model = TransitionModel(arm())
    for s, a, outcome in ((81, 0, 0), (0, 16, 0), (0, 0, 81), (0, 0, -1), (1.5, 0, 0), (0, 0.5, 0), (0, 0, 1.5), (0, 0, "1"), (0, None, 0)):
        for method in (model.observe, model.gain):
            with pytest.raises(InvalidValue, match="valid are 0 to"):
                method(s, a, outcome)
    assert model.tries.sum() == 0
    for options, message in (({"initial": "50-5"}, "Did you mean '50-50'"), ({"divergence": "kial"}, "Did you mean 'kail'")):
        with pytest.raises(UnknownName, match=message):
            TransitionModel(arm(), **options)


@pytest.mark.parametrize("forgetting", [0, 1.1, -1, float("nan")])
def test_a_forgetting_out_of_range_is_refused(forgetting):
    with pytest.raises(InvalidValue, match="forgets nothing"):
        TransitionModel(arm(), forgetting=forgetting)


def test_plain_kl_depends_on_the_number_of_states_and_is_equal_for_success_and_failure():
    few, many = TransitionModel(torso(), divergence="kl"), TransitionModel(arm(), divergence="kl")
    assert few.reward[0, 0] == few.gain(0, 0, 0) == few.gain(0, 0, few.space.goal(0, 0)) == few.gain(0, 0, 26)
    assert few.reward[0, 0] == pytest.approx(kl_divergence([2] + [1] * 26, [1] * 27))
    assert few.reward[0, 0] > 2 * many.reward[0, 0]
    assert TransitionModel(torso()).reward[0, 0] == TransitionModel(arm()).reward[0, 0]


def test_the_probabilities_do_not_depend_on_the_divergence():
    models = [TransitionModel(arm(), divergence=divergence) for divergence in ("kail", "kl")]
    for model in models:
        for outcome in (5, 5, 0, 7):
            model.observe(0, 1, outcome)
    assert np.array_equal(models[0].probabilities, models[1].probabilities)


def test_a_model_that_forgets_is_interested_again_and_unlearns_what_changed():
    forgetful, faithful = TransitionModel(arm(), forgetting=0.8), TransitionModel(arm())
    for model in (forgetful, faithful):
        goal = model.space.goal(0, 0)
        for outcome in [goal] * 100 + [0] * 10:
            model.observe(0, 0, outcome)
    assert forgetful.reward[0, 0] > faithful.reward[0, 0]
    assert forgetful.probabilities[0, 0, 0] > 0.6 > 0.2 > faithful.probabilities[0, 0, 0]


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_is_independent(copied):
    model = TransitionModel(arm(neighbours="equidistant"))
    model.debiased()
    for outcome in OTHERS:
        model.observe(S, ACTION, outcome)
    before, plan = model.counts.copy(), value_iteration(model, model.reward)[1]
    other = copied(model)
    for outcome in (20, 21, 22, GOAL):
        assert other.observe(S, ACTION, outcome) > 0.0
    assert np.array_equal(model.counts, before) and other.tries.sum() == 7
    assert np.array_equal(value_iteration(model, model.reward)[1], plan)
    assert not np.array_equal(value_iteration(other.debiased(), other.reward)[1], plan)
    for outcome in (20, 21, 22, GOAL):
        model.observe(S, ACTION, outcome)
    for one, two in ((model, other), (model.debiased(), other.debiased())):
        assert np.array_equal(one.probabilities, two.probabilities) and np.array_equal(one.outcomes, two.outcomes)


def test_numbers_of_numpy_name_states_and_actions_too():
    model = TransitionModel(arm(neighbours="equidistant"))
    found = model.observe(np.int64(S), np.intp(ACTION), np.int32(7))
    assert found == pytest.approx(0.0487, abs=PRINTED) and model.tries[S, ACTION] == 1


def test_the_order_of_goals_in_memory_does_not_matter():
    space = arm(neighbours="equidistant")
    other = Space(space.robot, space.joints, space.samples, np.asfortranarray(space.goals))
    models = [TransitionModel(one) for one in (space, other)]
    for model in models:
        model.debiased()
        for outcome in (*OTHERS, GOAL):
            model.observe(S, ACTION, outcome)
    plans = [value_iteration(known, model.reward)[1] for model in models for known in (model, model.debiased())]
    assert np.array_equal(plans[0], plans[2]) and np.array_equal(plans[1], plans[3])


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
def test_it_is_always_the_real_counts_over_the_prior(before, after, initial, forgetting):
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


@pytest.mark.parametrize(
    ("p", "t", "printed"),
    [
        ((1, 2, 1), (1, 1, 1), 0.0589),
        ((2, 1, 1), (1, 1, 1), 0.0589),
        ((1, 1, 2, 1, 1), (1,) * 5, 0.0487),
        ((1, 1, 1, 2, 1, 1, 1), (1,) * 7, 0.0398),
    ],
    ids=["6.6", "6.7", "6.8", "6.9"],
)
def test_equations_6_6_to_6_9(p, t, printed):
    assert kl_divergence(p, t) == pytest.approx(printed, abs=PRINTED)


@given(st.lists(st.floats(0.1, 1000), min_size=1, max_size=30), st.integers(0, 29))
def test_the_closed_form_is_the_divergence_when_one_bin_grows(counts, chosen):
    old = np.array(counts)
    new = old.copy()
    new[chosen % len(old)] += 1.0
    assert information_gain(old[chosen % len(old)], old.sum()) == pytest.approx(kl_divergence(new, old), rel=1e-9, abs=1e-13)


@given(st.floats(1, 1e9), st.floats(0, 1e9))
def test_a_gain_is_never_negative(count, others):
    assert information_gain(count, count + others) >= 0.0


@pytest.mark.parametrize(
    ("p", "t"),
    [((1, 0), (1, 1)), ((1, 1), (1, 0)), ((1,), (1, 1)), ((), ()), ((1, np.nan), (1, 1)), ((1, np.inf), (1, 1)), ((1, 1), (1, np.inf))],
)
def test_divergence_is_refused_where_it_is_undefined(p, t):
    with pytest.raises(InvalidValue, match="bins"):
        kl_divergence(p, t)
