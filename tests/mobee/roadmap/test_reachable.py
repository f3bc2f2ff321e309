# SPDX-License-Identifier: Apache-2.0
"""The smallest distance of a marker from a place, against places with a known answer."""

from __future__ import annotations

import numpy as np
import pytest

from mobee import InvalidValue, Model, UnknownName, load_robot
from mobee.roadmap.ik.solve import body_at, nearest_outside, nearest_posture
from tests.mobee.planar import planar_arm

ROBOT = load_robot("icub")
MODEL = Model(ROBOT)
ARM = ROBOT.part("right_arm").slice


def postures(rng: np.random.Generator, count: int) -> np.ndarray:
    q = np.repeat(ROBOT.home[None, :], count, axis=0)
    q[:, ARM] = rng.uniform(*ROBOT.limits[ARM].T, (count, len(ROBOT.part("right_arm"))))
    return q


def test_a_place_where_the_marker_has_been_is_found_again(rng: np.random.Generator) -> None:
    for position in MODEL.evaluate(postures(rng, 20)).position("right_palm"):
        found = nearest_posture(MODEL, "right_arm", "right_palm", position, ROBOT.home)
        assert found.distance < 1e-4
        np.testing.assert_allclose(MODEL.evaluate(found.q).position("right_palm"), found.position, atol=1e-12)
        assert (found.q >= ROBOT.limits[:, 0]).all() and (found.q <= ROBOT.limits[:, 1]).all()
        others = np.delete(np.arange(len(found.q)), np.arange(ARM.start, ARM.stop))
        np.testing.assert_array_equal(found.q[others], ROBOT.home[others])


@pytest.mark.parametrize("position", [(-2.0, 0.5, 0.3), (0.0, 0.2, -1.5), (-0.3, -0.8, 0.1), (1.0, 1.0, 1.0)])
def test_no_posture_of_many_is_nearer_to_a_place_out_of_reach(position: tuple[float, float, float], rng: np.random.Generator) -> None:
    found = nearest_posture(MODEL, "right_arm", "right_palm", np.array(position), ROBOT.home)
    many = MODEL.evaluate(postures(rng, 50_000)).position("right_palm")
    assert 0.05 < found.distance <= np.linalg.norm(many - position, axis=1).min()


def test_the_same_seed_finds_the_same() -> None:
    one, other = (nearest_posture(MODEL, "right_arm", "right_palm", np.array([-0.9, 0.3, 0.2]), ROBOT.home) for _ in range(2))
    np.testing.assert_array_equal(one.q, other.q)


def test_a_place_in_the_body_is_known_by_the_link_that_is_there() -> None:
    left = MODEL.evaluate(ROBOT.home).position("left_palm")
    assert body_at(MODEL, "right_arm", left, ROBOT.home) == "l_hand"
    assert body_at(MODEL, "left_arm", left, ROBOT.home) is None  # it can be taken away from there
    assert body_at(MODEL, "right_arm", np.array([0.0, 0.0, 0.1]), ROBOT.home) in ROBOT.links
    assert body_at(MODEL, "right_arm", np.array([-0.4, 0.3, 0.3]), ROBOT.home) is None


def test_a_place_in_the_base_on_which_the_robot_stands_is_in_the_body() -> None:
    model = Model(planar_arm())
    post = model.robot.shapes[0]
    assert model.robot.base_shapes == {0}
    assert body_at(model, "arm", post.position, model.robot.home) == "base"


def test_the_place_outside_the_body_is_free_near_and_can_be_come_to() -> None:
    inside = np.array([0.0, 0.0, 0.1])
    free = nearest_outside(MODEL, "right_arm", "right_palm", inside, ROBOT.home)
    assert free is not None and np.linalg.norm(free - inside) < 0.15
    assert body_at(MODEL, "right_arm", free, ROBOT.home) is None
    assert nearest_posture(MODEL, "right_arm", "right_palm", free, ROBOT.home).distance < 0.02
    assert nearest_outside(MODEL, "right_arm", "right_palm", np.array([5.0, 0.0, 0.1]), ROBOT.home) is None


def test_a_part_that_does_not_move_the_marker_is_refused_with_the_valid_ones() -> None:
    with pytest.raises(InvalidValue, match="right_arm does not move the marker 'left_palm'. Valid: .*right_palm"):
        nearest_posture(MODEL, "right_arm", "left_palm", np.zeros(3), ROBOT.home)
    with pytest.raises(UnknownName, match="right_palm"):
        nearest_posture(MODEL, "right_arm", "right_plam", np.zeros(3), ROBOT.home)
    with pytest.raises(InvalidValue, match="place.*3"):
        nearest_posture(MODEL, "right_arm", "right_palm", np.zeros(2), ROBOT.home)
