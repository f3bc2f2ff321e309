# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.robot.bodies import ball_of_water, can_be, from_six, one_a_link, to_six
from mobee.robot.robot import Body


def cloud(seed: int, count: int) -> tuple[Array, Array]:
    """Masses and places of points."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0.1, 2.0, count), rng.normal(size=(count, 3))


def body_of(masses: Array, points: Array, link: int = 1) -> Body:
    centre = masses @ points / masses.sum()
    arms = points - centre
    inertia = (masses * (arms**2).sum(axis=1)).sum() * np.eye(3) - (arms * masses[:, None]).T @ arms
    return Body(link, float(masses.sum()), centre, inertia)


@given(st.integers(0, 2**32 - 1))
def test_two_clouds_of_points_on_one_link_are_one_cloud(seed: int) -> None:
    masses, points = cloud(seed, 8)
    (found,) = one_a_link([body_of(masses[:3], points[:3]), body_of(masses[3:], points[3:])])
    whole = body_of(masses, points)
    assert np.isclose(found.mass, whole.mass)
    np.testing.assert_allclose(found.centre, whole.centre, atol=1e-12)
    np.testing.assert_allclose(found.inertia, whole.inertia, atol=1e-9)
    assert can_be(found.inertia)


def test_an_unknown_inertia_stays_unknown_and_links_are_in_order() -> None:
    masses, points = cloud(0, 4)
    two, one = body_of(masses, points, link=2), body_of(masses, points, link=1)
    found = one_a_link([two, one, Body(2, 1.0, np.zeros(3))])
    assert [body.link for body in found] == [1, 2]
    assert found[0] is one
    assert found[1].inertia is None


def test_impossible_moments_of_inertia_are_found() -> None:
    assert can_be(np.diag([1.0, 1.0, 2.0]))  # a flat disc
    assert not can_be(np.diag([1.0, 1.0, 2.1]))
    assert not can_be(np.diag([-0.1, 1.0, 1.0]))


def test_a_ball_of_a_litre_of_water() -> None:
    np.testing.assert_allclose(ball_of_water(1.0), 0.4 * 0.0620350**2 * np.eye(3), rtol=1e-5)


def test_six_numbers_are_the_inertia() -> None:
    six = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    inertia = from_six(six)
    assert (inertia == inertia.T).all()
    assert to_six(inertia) == six
