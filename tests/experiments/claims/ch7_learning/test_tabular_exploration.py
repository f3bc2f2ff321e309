# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse

import numpy as np
import pytest

from experiments.claims.ch7_learning import tabular_exploration as study
from experiments.kit.learning import rivals
from mobee import CuriousAgent
from mobee.learning.tabular import deep_sea, river_swim
from tests.experiments.finished_cells import Cell, finished


def test_explorers_that_plan_find_the_reward_in_deep_sea_and_others_miss_it():
    settings = {"task": "return", "world": "DeepSea-10", "explorer": "curious", "number": 0.1}
    assert study.trial(settings, 0)["share"] > 0.8
    for explorer, number, span in (("count bonus", 0.1, (0.8, 1.0)), ("R-MAX", 3, (0.6, 1.0)), ("epsilon-greedy", 0.1, (-0.1, 0.1))):
        low, high = span
        assert low < study.trial({**settings, "explorer": explorer, "number": number}, 0)["share"] < high


def test_the_best_reward_is_that_of_the_best_policy():
    sea = rivals.RewardedPlant(deep_sea(5), 0)
    assert study.best_reward(sea) == pytest.approx(0.99 / 5, rel=1e-3)
    river = rivals.RewardedPlant(river_swim(6), 0)
    share = np.linalg.matrix_power(right_alone(), 4000)[0, 5]  # of the time at the right end, if one always swims right
    assert study.best_reward(river) == pytest.approx(share, rel=1e-3)


def right_alone() -> np.ndarray:
    river, table = river_swim(6), np.zeros((6, 6))
    for state in range(6):
        np.add.at(table[state], river.outcomes[state, 1], river.probabilities[state, 1])
    return table


def test_posterior_sampling_believes_what_it_saw_often():
    plant = rivals.RewardedPlant(river_swim(6), 0)
    explorer = rivals.PosteriorSampling(plant, 20)
    agent = CuriousAgent(plant.space, plant, explorer, discount=0.99, beliefs="debiased")
    agent.run(3000)
    counts = rivals.all_counts(agent)
    assert counts.sum() == 3000 and np.array_equal(counts.sum(axis=2), agent.model.tries)
    assert agent.model.tries[5, 1] > 500  # it found the right end
    assert np.array_equal(plant.known[agent.model.tries > 0], plant.truth[agent.model.tries > 0])


def test_the_worlds_are_worlds():
    four = rivals.rooms()
    assert len(four.outcomes) == 104
    plant = rivals.RewardedPlant(four, 0)
    assert study.reached_from(plant).all()
    moves = {(s, int(four.outcomes[s, a, 0])) for s in range(103) for a in range(4)}
    assert all((after, before) in moves for before, after in moves if after != 103)  # every door can be passed in both directions
    drawn = rivals.RewardedPlant(rivals.random_world(3), 0)
    assert drawn.largest == 1.0 and np.array_equal(drawn.outcomes, rivals.random_world(3).outcomes)


def test_coverage_counts_reachable_points_only():
    values = study.trial({"task": "coverage", "world": "DeepSea-10", "explorer": "nearest untried", "number": 0.0}, 0)
    assert (values["pairs"], values["once"], values["often"], values["finished"]) == (110, 200, 1000, [True, True])
    stuck = study.trial({"task": "coverage", "world": "DeepSea-10", "explorer": "random", "number": 0.0}, 0)
    assert stuck["once"] == stuck["most"] and stuck["finished"] == [False, False] and stuck["error"] > 3 * values["error"]


def test_a_short_version_has_a_row_for_each_condition_and_can_be_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    parser = argparse.ArgumentParser()
    study.EXPERIMENT.method.add_arguments(parser)
    options = ["--quick", "--seeds", "1", "--jobs", "1"]
    arguments = argparse.Namespace(seed=0, **vars(parser.parse_args(options)))
    names = [condition.name for condition in study.conditions(arguments)]
    assert len(set(names)) == len(names) == 2 * (len(study.COVERAGE) + len(study.CHOSEN))
    cells = [Cell(f"{one.name}-s0", 0, one.settings) for one in study.conditions(arguments) if one.settings["world"] == "RiverSwim-6"]
    found = finished(lambda cell: study.trial(cell.settings, cell.seed), cells)
    results = study.findings(found)
    assert len(results["runs"]) == len(cells)
    study.plot(found).savefig(tmp_path / "figure.png")
    tuning = argparse.Namespace(seed=0, **vars(parser.parse_args([*options, "--tune"])))
    tuned = study.conditions(tuning)
    assert len(tuned) == 2 * sum(len(numbers) for numbers in study.RETURN.values())
    assert {seed for condition in tuned for seed in condition.seeds} == {study.TUNING_SEED}
    assert {(name, number) for name, number in study.CHOSEN.items()} <= {
        (name, number) for name in study.RETURN for number in study.RETURN[name]
    }
