from __future__ import annotations

import numpy as np
import pytest

from experiments.learning.model_error import l1
from experiments.learning.truth import load_truth, measure_truth, truth_of, walk
from mobee.errors import InvalidValue
from mobee.learning.tabular import TabularPlant, half_space
from tests.mobee.learning.toys import arm, torso

SPACE = arm(neighbours="equidistant")


def plant_of(seed):
    return TabularPlant(SPACE, *half_space(SPACE), seed)


def test_a_walk_tries_every_action_often_enough_and_begins_where_it_ended():
    seen = walk(SPACE, plant_of, tries=3, most=20_000, seed=0)
    tries = np.zeros(SPACE.goals.shape)
    np.add.at(tries, (seen[:, 0], seen[:, 1]), 1)
    assert tries[SPACE.goals >= 0].min() == 3
    assert np.array_equal(seen[1:, 0], seen[:-1, 2])


def test_a_walk_ends_at_its_limit():
    assert len(walk(SPACE, plant_of, tries=3, most=100, seed=0)) == 100


def test_the_truth_is_the_frequencies_of_what_was_seen():
    truth = truth_of(SPACE, np.array([[0, 0, 1], [0, 0, 1], [0, 0, 40], [80, 3, 0], [0, 1, 1]]))
    assert truth.tries.sum() == 5 and truth.tries[0, 0] == 3 and truth.tries[80, 3] == 1
    assert dict(zip(truth.outcomes[0, 0], truth.probabilities[0, 0], strict=True)) == pytest.approx({1: 2 / 3, 40: 1 / 3})
    assert truth.outcomes[80, 3, 0] == 0 and truth.probabilities[80, 3].tolist() == [1, 0]
    assert truth.probabilities.sum() == pytest.approx(3)


def test_walks_of_several_seeds_find_the_table_that_the_plant_draws_from():
    truth = measure_truth(SPACE, plant_of, tries=25, seeds=[1, 2], most=40_000, processes=1)
    error = l1(truth, plant_of(0))
    assert truth.tries[SPACE.goals >= 0].min() >= 50
    stochastic = plant_of(0).probabilities.max(axis=-1) < 1
    stochastic &= SPACE.goals >= 0
    assert (error[(SPACE.goals >= 0) & ~stochastic] == 0).all()
    assert error[stochastic].mean() < 0.3  # about 9 outcomes and 60 tries each


def test_it_comes_back_from_its_file_and_is_refused_for_another_space(tmp_path):
    truth = truth_of(SPACE, np.array([[0, 0, 1], [0, 0, 40]]))
    truth.save(tmp_path / "truth.npz")
    again = load_truth(tmp_path / "truth.npz", SPACE)
    assert np.array_equal(again.outcomes, truth.outcomes) and np.array_equal(again.probabilities, truth.probabilities)
    assert np.array_equal(again.tries, truth.tries) and again.settings == truth.settings
    with pytest.raises(InvalidValue, match="another space"):
        load_truth(tmp_path / "truth.npz", torso())
