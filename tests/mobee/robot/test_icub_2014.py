# SPDX-License-Identifier: Apache-2.0
"""The published iCub model against its own numbers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from tests.mobee.robot.poses import marker_frame, motor_vector, reference_poses


@pytest.fixture(scope="module")
def icub_2014() -> Robot:
    return load_robot("icub_2014")


def test_counts_are_the_published_ones(icub_2014: Robot) -> None:
    roles = [shape.role for shape in icub_2014.shapes]
    assert (len(icub_2014.motors), len(icub_2014.joints)) == (41, 64)
    assert (roles.count("solid"), roles.count("field")) == (108, 66)


def test_motors_links_and_markers_are_called_as_in_icub(icub_2014: Robot) -> None:
    icub = load_robot("icub")
    assert icub_2014.motors == icub.motors
    assert set(icub_2014.markers) == set(icub.markers)
    assert {"chest", "head", "l_forearm", "r_forearm", "l_hand", "r_hand"} <= set(icub_2014.links) & set(icub.links)


def test_markers_stand_where_the_published_model_puts_them(icub_2014: Robot) -> None:
    for pose in reference_poses("icub_2014_poses.json"):
        q = motor_vector(icub_2014, pose["q_deg"])
        for name, expected in pose["markers"].items():
            position, _, normal = marker_frame(icub_2014, name, q)
            np.testing.assert_allclose(position, expected["p"], atol=1e-5)
            np.testing.assert_allclose(normal, expected["n"], atol=1e-5)


def test_nothing_touches_at_home(icub_2014: Robot) -> None:
    assert Model(icub_2014).evaluate(icub_2014.home).contacts == ()


def test_no_lattice_state_of_an_arm_or_of_the_torso_touches_the_own_body(icub_2014: Robot) -> None:
    model, middle = Model(icub_2014), icub_2014.limits.mean(axis=1)
    middle[icub_2014.parts["head"].slice] = 0
    for part, count in (("left_arm", 4), ("torso", 3)):
        chosen = slice(icub_2014.parts[part].start, icub_2014.parts[part].start + count)
        low, high = icub_2014.limits[chosen].T
        for levels in itertools.product((0.25, 0.5, 0.75), repeat=count):
            q = middle.copy()
            q[chosen] = low + (high - low) * levels
            assert [contact for contact in model.evaluate(q).contacts if contact.kind == "field"] == []
