# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue, MobeeError
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import METHODS, policy_iteration, value_iteration
from mobee.reference.learning import action_values
from tests.mobee.learning.tables import Table, chain, random_problem
from tests.mobee.learning.toys import arm


def experienced(neighbours, seed, transitions=400):
    model = TransitionModel(arm(neighbours=neighbours))
    rng = np.random.default_rng(seed)
    for _ in range(transitions):
        s = int(rng.integers(81))
        model.observe(s, int(rng.integers(len(model.space.actions(s)))), int(rng.integers(81)))
    return model


def residual(model, reward, discount, values):
    """The largest change of a value by one more sweep, states without actions left out."""
    found = action_values(model.outcomes, model.probabilities, reward, discount, values)
    acting = np.isfinite(found).any(axis=1)
    return np.abs(found[acting].max(axis=1) - values[acting]).max(initial=0.0)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("seed", range(60))
def test_values_of_random_problems_are_those_of_policy_iteration(seed, method):
    model, reward, discount = random_problem(seed)
    v, q = value_iteration(model, reward, discount, tolerance=1e-12, relative=True, method=method)
    exact_v, exact_q = policy_iteration(model, reward, discount)
    assert np.array_equal(np.isfinite(q), np.isfinite(exact_q))
    size = np.abs(exact_v).max(initial=1.0)
    assert np.abs(v - exact_v).max() < 1e-9 * size
    assert np.abs(q[np.isfinite(q)] - exact_q[np.isfinite(q)]).max(initial=0.0) < 1e-9 * size


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("seed", range(20))
def test_one_more_sweep_changes_no_value_by_the_tolerance(seed, relative, method):
    model, reward, discount = random_problem(seed)
    exists = model.probabilities.any(axis=-1) & (reward != -np.inf)
    start = np.where(exists.any(axis=1), np.random.default_rng(seed).normal(scale=100.0, size=len(reward)), 0.0)
    v, _ = value_iteration(model, reward, discount, 1e-4, start, relative, method)
    scale = np.abs(reward[exists]).max(initial=0.0) if relative and exists.any() else 1.0
    assert residual(model, reward, discount, v) < 1e-4 * scale


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("neighbours", [16, "equidistant"])
@pytest.mark.parametrize("sign", [1, -1])
def test_values_of_an_experienced_model_are_those_of_policy_iteration(neighbours, sign, method):
    model = experienced(neighbours, seed=1)
    reward = np.where(model.reward == -np.inf, -np.inf, sign * model.reward)
    v, q = value_iteration(model, reward, 0.99, tolerance=1e-12, method=method)
    exact_v, _ = policy_iteration(model, reward, 0.99)
    assert np.abs(v - exact_v).max() < 1e-9
    assert np.array_equal(q == -np.inf, reward == -np.inf)


@pytest.mark.parametrize("method", METHODS)
def test_a_relative_tolerance_makes_the_plan_independent_of_the_unit_of_the_reward(method):
    model = experienced("equidistant", seed=5)
    options = {"tolerance": 0.01, "relative": True, "method": method}
    _, q = value_iteration(model, model.reward, **options)
    _, small = value_iteration(model, model.reward / 1024, **options)
    assert np.array_equal(small * 1024, q)


def test_without_any_reward_a_relative_tolerance_is_an_absolute_one():
    model, _ = chain()
    v, _ = value_iteration(model, np.zeros((6, 1)), tolerance=1e-3, start=np.full(6, 50.0), relative=True)
    assert 0 < v.max() < 1e-2


def test_it_reads_the_tables_of_a_model_where_they_are(monkeypatch):
    model = experienced(16, seed=6)
    seen = []
    from mobee._core import learning as core

    known, solve = core.Table, core.solve
    monkeypatch.setattr(core, "Table", lambda *given: seen.extend(given[:2]) or known(*given))
    monkeypatch.setattr(core, "solve", lambda *given: seen.append(given[1]) or solve(*given))
    value_iteration(Table(model.outcomes, model.probabilities), model.reward)
    assert seen == [one.__array_interface__["data"][0] for one in (model.probabilities, model.outcomes, model.reward)]


def test_plans_are_equal_with_and_without_cached_tables():
    model = TransitionModel(arm(neighbours="equidistant"))
    rng = np.random.default_rng(7)
    for number in range(300):
        s = int(rng.integers(81))
        model.observe(s, int(rng.integers(len(model.space.actions(s)))), int(rng.integers(81)))
        for known in (model, model.debiased()) if number % 50 == 0 else ():
            own = value_iteration(known, model.reward, 0.99, 1e-6, method="modified")
            again = value_iteration(Table(known.outcomes, known.probabilities), model.reward, 0.99, 1e-6, method="modified")
            assert all(np.array_equal(*both) for both in zip(own, again, strict=True))


@pytest.mark.parametrize("method", METHODS)
def test_negative_rewards_spread_along_the_chain(method):
    v, _ = value_iteration(*chain(), method=method)
    assert v == pytest.approx([-4.0951, -3.439, -2.71, -1.9, -1, 0], abs=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_values_fall_after_a_warm_start_when_a_reward_fell(method):
    model, _ = chain()
    high = np.zeros((6, 1))
    high[5] = 1.0
    before, _ = value_iteration(model, high, tolerance=1e-12)
    after, _ = value_iteration(model, 0.1 * high, tolerance=1e-12, start=before, method=method)
    assert after == pytest.approx(0.1 * before, abs=1e-9)
    assert before[5] == pytest.approx(10.0)


def test_a_warm_start_finds_the_same_values():
    model = experienced("equidistant", seed=2)
    cold, _ = value_iteration(model, model.reward, tolerance=1e-12)
    warm, _ = value_iteration(model, model.reward, tolerance=1e-12, start=np.random.default_rng(0).normal(size=81))
    assert warm == pytest.approx(cold, abs=1e-9)


def test_a_cold_start_whose_rewards_are_all_below_the_tolerance_stops_after_one_sweep():
    model, _ = chain()
    v, _ = value_iteration(model, np.full((6, 1), 1e-4))
    assert v == pytest.approx(np.full(6, 1e-4))


def test_it_ends_with_values_too_large_for_the_tolerance():
    model = experienced(16, seed=3)
    v, _ = value_iteration(model, 1e9 * model.reward, tolerance=1e-12)
    assert v == pytest.approx(1e9 * value_iteration(model, model.reward, tolerance=1e-12)[0], rel=1e-9)


@pytest.mark.parametrize("seed", [78, 310, 568])
def test_it_ends_where_rounding_goes_round_in_a_cycle(seed):
    model, reward, discount = random_problem(seed)
    v, _ = value_iteration(model, reward, discount, tolerance=1e-12, method="modified")
    exact, _ = policy_iteration(model, reward, discount)
    assert np.abs(v - exact).max() < 1e-9 * np.abs(exact).max()


def test_minus_infinity_takes_an_action_out_and_a_state_without_actions_keeps_its_start():
    model, reward = chain()
    reward[5] = -np.inf
    v, q = value_iteration(model, reward, start=np.array([0, 0, 0, 0, 0, 7.0]), tolerance=1e-12)
    assert v[5] == 7.0 and q[5, 0] == -np.inf
    assert v[4] == pytest.approx(-1 + 0.9 * 7)


def test_entries_without_an_action_are_ignored():
    model = TransitionModel(arm(neighbours="equidistant"))
    everywhere, _ = value_iteration(model, np.ones((81, 8)))
    only_actions, _ = value_iteration(model, np.where(model.space.goals == -1, -np.inf, 1.0))
    assert np.array_equal(everywhere, only_actions)


@pytest.mark.parametrize(
    "options",
    [
        {"discount": 1.0},
        {"discount": -0.1},
        {"tolerance": 0.0},
        {"reward": np.zeros(6)},
        {"reward": np.full((6, 1), np.nan)},
        {"reward": np.full((6, 1), np.inf)},
        {"start": np.zeros(5)},
        {"start": np.full(6, np.nan)},
        {"method": "gauss"},
        {"tolerance": np.nan},
    ],
)
def test_arguments_out_of_range_are_refused(options):
    model, reward = chain()
    with pytest.raises(MobeeError, match="[Vv]alid|give"):
        value_iteration(model, **({"reward": reward} | options))


def test_a_model_that_leads_out_of_its_states_is_refused():
    model, reward = chain()
    for state in (6, -1):
        model.outcomes[5] = state
        with pytest.raises(InvalidValue, match="valid are 0 to 5"):
            value_iteration(model, reward)


def test_tables_of_unequal_shape_are_refused():
    model, reward = chain()
    with pytest.raises(InvalidValue, match=r"valid is \(S, A, B\)"):
        value_iteration(Table(model.outcomes, np.ones((6, 1, 2))), reward)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("discount", [0.5, 0.9, 0.99])
def test_actions_of_which_nothing_is_known_stay_ties(method, discount):
    model = TransitionModel(arm(neighbours=16))
    _, q = value_iteration(model, model.reward, discount, 0.01, relative=True, method=method)
    assert np.ptp(q) < 1e-12


def dense_policy_iteration(model, reward, discount):
    """The oracle: dense matrices, each state without actions an absorbing one that pays nothing."""
    states, actions, _ = model.outcomes.shape
    moves = np.zeros((states, actions, states))
    np.add.at(moves, (*np.ogrid[:states, :actions, :1][:2], model.outcomes), model.probabilities)
    reward = np.where(moves.any(axis=-1), reward, -np.inf)
    for s in np.flatnonzero((reward == -np.inf).all(axis=1)):
        moves[s, 0] = 0.0
        reward[s, 0] = 0.0
    rows, policy = np.arange(states), reward.argmax(axis=1)
    for _ in range(100):
        v = np.linalg.solve(np.eye(states) - discount * moves[rows, policy], reward[rows, policy])
        policy = (reward + discount * moves @ v).argmax(axis=1)
    return v


@pytest.mark.parametrize("seed", range(50))
def test_values_are_those_of_dense_solves(seed):
    model, reward, discount = random_problem(seed)
    v, q = policy_iteration(model, reward, discount)
    assert v == pytest.approx(dense_policy_iteration(model, reward, discount), rel=1e-9, abs=1e-9)
    acting = np.isfinite(q).any(axis=1)
    assert v[acting] == pytest.approx(q[acting].max(axis=1), rel=1e-9, abs=1e-9)


def test_the_chain_of_negative_rewards():
    v, _ = policy_iteration(*chain())
    assert v == pytest.approx([-4.0951, -3.439, -2.71, -1.9, -1, 0], abs=1e-12)


def test_a_reward_that_is_no_number_is_refused():
    model, reward = chain()
    reward[2] = np.inf
    with pytest.raises(InvalidValue, match="valid are finite values"):
        policy_iteration(model, reward)
