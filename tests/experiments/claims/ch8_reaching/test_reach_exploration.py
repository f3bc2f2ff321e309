# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.claims.ch8_reaching import reach_exploration
from experiments.claims.ch8_reaching.reach_exploration import (
    CHECKPOINTS,
    CLAIMS,
    agree,
    best,
    decreases,
    few,
    negative,
    plot,
    same_states,
    speed,
    steady,
    time,
    time_greedy,
    trial,
    weak_early,
)
from experiments.claims.ch8_reaching.reach_measures import Runs
from experiments.kit.experiment import judged
from experiments.kit.reaching import arm
from tests.experiments.finished_cells import Cell, finished

STATES, TARGETS, SEEDS = 81, 27, 8


def values(seed: int, scores, favourites: int, failures: int, hours: float):
    """A run whose evaluations reach from the first `favourites` states."""
    rng = np.random.default_rng(seed)
    rewards = np.array([np.full((5, TARGETS), score / TARGETS) for score in scores]) * rng.uniform(0.98, 1.02)
    states = rng.integers(favourites, size=(len(scores), 5, TARGETS))
    states[0] = rng.integers(STATES, size=(5, TARGETS))
    tries = CHECKPOINTS[-1]
    fails = np.zeros((STATES, 8), dtype=int)
    fails[0, 0] = failures + seed
    return {
        "rewards_grid": rewards,
        "states_grid": states,
        "problem": np.arange(tries) % TARGETS,
        "reach_state": rng.integers(min(STATES, 40 * favourites), size=tries),
        "mean_actions": 1.0,
        "hours": hours,
        "failures": fails,
    }


def runs(**changes):
    made = {
        "intrinsic": ((4.8, 5.0, 5.2, 6.4, 7.9, 7.9, 7.0), 2, 100, 22.6),
        "greedy": ((5.2, 5.2, 5.4, 5.5, 5.7, 5.8, 6.0), 40, 120, 21.8),
        "random": ((5.3, 5.0, 4.9, 5.0, 5.1, 5.4, 5.6), 60, 500, 41.4),
    } | changes
    return {name: Runs(tuple(values(seed, *given) for seed in range(SEEDS)), (30.0,) * SEEDS, CHECKPOINTS) for name, given in made.items()}


@pytest.mark.parametrize(("seconds", "verdict"), [((30.0,) * SEEDS, "met"), ((85.0, 75.0) * 4, "open"), ((90.0,) * SEEDS, "not met")])
def test_the_interval_of_the_computing_times_decides_whether_the_runs_are_fast_enough(seconds, verdict):
    assert verdicts({name: replace(group, seconds=seconds) for name, group in runs().items()})[speed.text] == verdict


def verdicts(*units) -> dict[str, str]:
    named = {f"{unit} cm": runs for unit, runs in zip((1, 3, 10), units, strict=False)}
    return {claim["text"]: claim["verdict"] for claim in judged(CLAIMS, named)}


def test_the_published_findings_confirm_the_claims():
    found = verdicts(runs())
    for claim in (best, weak_early, steady, decreases, agree, few, negative, time, time_greedy):
        assert found[claim.text] == "confirmed", claim.text
    assert found[speed.text] == "met"


def test_a_better_greedy_agent_refutes_them_if_it_is_better_with_every_unit():
    broad = ((4.8, 5.0, 5.2, 6.4, 7.9, 7.9, 7.0), 20, 100, 22.6)
    other = runs(intrinsic=broad, greedy=((6.0, 6.5, 7.0, 8.0, 9.0, 9.0, 9.5), 1, 900, 60.0))
    for units, verdict in (((other,), "not reproduced"), ((other, other), "refuted"), ((other, runs()), "depends")):
        found = verdicts(*units)
        for claim in (best, agree, few, negative, time_greedy):
            assert found[claim.text] == verdict, claim.text


def test_equal_agents_whose_scores_never_change_refute_that_one_is_better_and_that_one_falls():
    same = ((5.0,) * 7, 3, 100, 20.0)
    found = verdicts(*[runs(intrinsic=same, greedy=same, random=same)] * 2)
    assert [found[claim.text] for claim in (best, decreases, time)] == ["refuted", "refuted", "refuted"]


@pytest.mark.parametrize(
    ("first", "second", "verdict"), [(57, 77, "confirmed"), (76, 56, "confirmed"), (57, 76, "not reproduced"), (0, 1, "not reproduced")]
)
def test_the_two_states_must_be_those_of_the_thesis(first, second, verdict):
    made = runs()
    for one in made["intrinsic"].values:
        one["states_grid"][-1] = np.where(one["states_grid"][-1] == 0, first, second)
    assert verdicts(made, made)[same_states.text] == verdict


def test_the_agreement_of_runs_is_the_overlap_of_their_choices():
    pair = [dict(values(0, (1.0,) * 7, 2, 0, 1.0)) for _ in range(2)]
    for one, states in zip(pair, ([0, 0, 1, 1], [0, 2, 2, 2]), strict=True):
        one["states_grid"] = np.tile(states, (7, 1))
    group = Runs(tuple(pair), (1.0, 1.0), CHECKPOINTS)
    assert group.agreement(100) == pytest.approx([0.25, 0.25])
    assert group.states_of_half(100).tolist() == [1.0, 1.0]


def test_the_settings_alone_decide_a_trial(monkeypatch):
    monkeypatch.setattr(reach_exploration, "learned_beliefs", lambda plant, seed: arm.learned_beliefs(plant, seed, 40))
    monkeypatch.setattr(reach_exploration, "REPETITIONS", 1)
    settings = {"strategy": "intrinsic", "law": "published", "scale": 0.01, "checkpoints": [4]}
    first, second = trial(settings, 5), trial(settings, 5)
    assert all(np.array_equal(first[name], second[name]) for name in first)
    assert first["rewards_grid"].shape == (1, 1, 27) and 0.0 < first["rewards_grid"].sum() < 27.0
    assert len(set(first["problem"].tolist())) == 4 and (first["duration"] > 2.0).all()


def test_a_run_is_drawn(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(reach_exploration, "HEIGHT", 40)  # small pictures take no time
    made = runs()
    cells = [
        Cell(f"{name}-s{seed}", seed, {"strategy": name, "scale": 0.01, "checkpoints": list(CHECKPOINTS)})
        for name in made
        for seed in range(2)
    ]
    plot(finished(lambda cell: made[cell.settings["strategy"]].values[cell.seed], cells)).savefig(tmp_path / "reach.png")
    assert (tmp_path / "reach.png").stat().st_size > 50_000
