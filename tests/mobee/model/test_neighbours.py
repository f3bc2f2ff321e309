# SPDX-License-Identifier: Apache-2.0
"""That the list is used and thrown away when it should be; that its results are right, test_track.py says."""

from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.model.model import Track
from tests.mobee.model.random_scenes import loaded, posed

POSE, LIST = 1, 2  # the remembered state


@pytest.fixture
def model() -> mobee.Model:
    return mobee.Model(loaded("icub"), mobee.load_world("table"))


def state(track: Track) -> tuple[int, int, int]:
    """The remembered state, the number of listed pairs, the number of poses for which the list was used."""
    assert track._neighbours is not None
    return track._neighbours._core.state()


def creep(model: mobee.Model, track: Track, steps: int, step: float) -> None:
    for k in range(steps):
        track.evaluate(model.robot.home + k * step)


def test_one_list_serves_many_small_steps(model: mobee.Model) -> None:
    track = model.track()
    creep(model, track, 50, 1e-5)
    assert state(track)[0] == LIST
    assert state(track)[2] == 48  # the first pose stands alone, the second makes the list


def test_a_list_is_built_again_after_motions_beyond_its_skin(model: mobee.Model) -> None:
    track = model.track()
    creep(model, track, 200, 1e-3)
    assert state(track)[0] == LIST
    assert 0 <= state(track)[2] < 30


def test_no_list_is_made_while_the_steps_are_large(model: mobee.Model, rng: np.random.Generator) -> None:
    track = model.track()
    for q in posed(rng, model.robot, 20):
        track.evaluate(q)
        assert state(track)[0] == POSE


def test_a_jump_costs_no_list_and_rest_brings_one_back(model: mobee.Model, rng: np.random.Generator) -> None:
    track = model.track()
    creep(model, track, 3, 1e-5)
    elsewhere = posed(rng, model.robot)
    found = []
    for q in (elsewhere, model.robot.home, elsewhere, elsewhere, elsewhere):
        track.evaluate(q)
        found.append(int(state(track)[0]))
    assert found == [POSE, POSE, POSE, LIST, LIST]


def test_a_list_of_use_is_made_again_at_once_when_the_world_has_changed(model: mobee.Model) -> None:
    track = model.track()
    creep(model, track, 10, 1e-5)
    model.world.add("far away", mobee.sphere(0.05), position=(0.0, 0.0, 5.0))
    track.evaluate(model.robot.home)
    assert (state(track)[0], state(track)[2]) == (LIST, 0)


def test_a_world_in_motion_gets_no_lists_until_it_rests(model: mobee.Model) -> None:
    track, made = model.track(), 0
    for k in range(30):
        if k % 3 == 0:
            model.world.move("ball", position=(0.0, 0.0, 5.0 + k))
        track.evaluate(model.robot.home + k * 1e-5)
        made += state(track)[0] == LIST and state(track)[2] == 0
    assert made == 1
    creep(model, track, 6, 1e-5)
    assert state(track)[0] == LIST


def test_a_larger_skin_lists_more_pairs(model: mobee.Model) -> None:
    listed = []
    for skin in (0.001, 0.02, 0.2):
        track = model.track(skin)
        creep(model, track, 3, 1e-6)
        listed.append(int(state(track)[1]))
    assert listed == sorted(set(listed))
