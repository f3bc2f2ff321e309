# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from mobee.rendering.camera import Camera, camera_axes
from mobee.rendering.picture import draw
from mobee.rendering.solid import Solid, ball

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
EYE = Camera(camera_axes((0.0, 30.0)), np.array([-0.5, 0.5]), 80.0, 80, 80)


def test_without_anything_the_paper_is_white() -> None:
    assert (draw([], EYE, floor=0.0) == 255).all()


def test_what_is_turned_to_the_light_is_brighter_than_what_is_turned_away() -> None:
    picture = draw([ball(np.zeros(3), 0.3, RED)], EYE).astype(int)
    assert picture[25, 35, 0] > picture[55, 50, 0] + 40
    assert (picture[40, 40, 1:] == 0).all()


def test_a_ball_in_the_air_darkens_the_floor_beneath_it() -> None:
    shape = [ball(np.array([0.0, 0.0, 0.1]), 0.1, RED)]
    bare, floor = draw(shape, EYE), draw(shape, EYE, floor=-0.2)
    white = (bare == 255).all(axis=2)
    assert (floor[white] < 230).any() and (floor[~white] == bare[~white]).mean() > 0.9


def test_a_solid_that_is_seen_through_shows_both_colours() -> None:
    glass = Solid("box", (0.1, 0.4, 0.4), -0.4 * EYE.axes[2], np.eye(3), RED, opacity=0.4)
    picture = draw([ball(np.zeros(3), 0.2, BLUE), glass], EYE)
    over = picture[40, 40].astype(int)
    assert over[0] > 40 and over[2] > 40


def test_what_is_veiled_shines_through_what_hides_it_and_casts_no_shadow() -> None:
    wall = Solid("box", (0.1, 0.6, 0.6), np.array([-0.3, 0.0, 0.0]), np.eye(3), (0.5, 0.5, 0.5))
    hidden = ball(np.array([0.2, 0.0, 0.0]), 0.05, BLUE, veiled=0.4)
    with_it, without = draw([wall, hidden], EYE).astype(int), draw([wall], EYE).astype(int)
    middle = EYE.pixels(hidden.position).astype(int)
    assert with_it[middle[1], middle[0], 2] > without[middle[1], middle[0], 2] + 30
    far = np.abs(np.indices((80, 80)) - middle[::-1, None, None]).max(axis=0) > 6
    np.testing.assert_array_equal(with_it[far], without[far])
