from __future__ import annotations

import copy

import numpy as np

from mobee.learning.draws import Draws


def test_who_draws_again_at_the_same_count_draws_the_same():
    first, again = Draws("torso"), Draws("torso")
    wanted = [first.at(3, n).random() for n in range(20)]
    assert [again.at(3, n).random() for n in reversed(range(20))] == wanted[::-1]


def test_nothing_is_left_of_the_draws_before():
    draws = Draws("torso")
    wanted = draws.at(0, 7).random(3).tolist()
    draws.at(0, 6).integers(5, dtype=np.int32)  # leaves half a word behind
    assert draws.at(0, 7).random(3).tolist() == wanted


def test_seeds_names_and_counts_tell_draws_apart():
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
