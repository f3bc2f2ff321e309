# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mobee
from mobee.reference.forces import projected
from tests.mobee.model.random_scenes import loaded, posed, random_robot, random_world


@given(st.integers(0, 2**32), st.integers(1, 8), st.integers(2, 12))
def test_projections_are_the_contacts_through_the_jacobians(seed: int, joints: int, shapes: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints, shapes)
    model = mobee.Model(robot, random_world(rng, robot, 20))
    for q in posed(rng, robot, 2):
        pose = model.evaluate(q)
        assert pose.projection == pytest.approx(projected(robot, q, pose.contacts), abs=1e-12)
        assert pose.projection_of_part == pytest.approx(projected(robot, q, pose.contacts, "part"), abs=1e-12)


@pytest.mark.parametrize("name", ["icub", "icub_2014"])
def test_with_cut_a_contact_acts_on_its_own_part_only(name: str, rng: np.random.Generator) -> None:
    robot = loaded(name)
    model = mobee.Model(robot, random_world(rng, robot, 30, 0.5))
    differ = 0
    for q in posed(rng, robot, 5):
        pose = model.evaluate(q)
        assert pose.projection == pytest.approx(projected(robot, q, pose.contacts), abs=1e-12)
        assert pose.projection_of_part == pytest.approx(projected(robot, q, pose.contacts, "part"), abs=1e-12)
        differ += not np.allclose(pose.projection, pose.projection_of_part)
    assert differ > 0


def test_poses_do_not_hear_of_their_neighbours_in_the_batch(rng: np.random.Generator) -> None:
    """What one pose leaves in the sums would push the next."""
    robot = loaded("icub")
    model = mobee.Model(robot)
    q = np.concatenate([posed(rng, robot, 20), np.tile(robot.home, (1, 1)), posed(rng, robot, 20)])
    home = model.evaluate(robot.home).projection
    assert np.array_equal(model.evaluate(q).projection[20], home)
    assert np.array_equal(model.evaluate(q[::-1]).projection[20], home)
