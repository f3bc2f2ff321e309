# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.control.gains import Gains
from mobee.model.model import Model
from mobee.model.pose import Pose
from tests.mobee.control.posed_forces import forces_at
from tests.mobee.control.two_parts import STRETCHED, touching, two_part_arm
from tests.mobee.planar import planar_arm

LEVERS = np.array([0.9, 0.6, 0.3])  # m, from the joints of the stretched arm to its tip


def collision_force(projection: np.ndarray, gains: Gains) -> np.ndarray:
    return forces_at(two_part_arm(), gains, STRETCHED, projection).collision


def test_the_projection_is_lever_times_penetration() -> None:
    projection = touching(-0.02).evaluate(STRETCHED).projection
    assert projection == pytest.approx(0.02 * LEVERS, abs=1e-6)


def test_within_the_part_the_projection_leaves_the_joints_below_alone() -> None:
    projection = touching(-0.02).evaluate(STRETCHED).projection_of_part
    assert projection == pytest.approx(0.02 * LEVERS * [0, 1, 1], abs=1e-6)


def test_solid_contacts_make_no_force() -> None:
    robot = two_part_arm()
    world = touching(-0.02).world
    solids = replace(robot, shapes=tuple(s for s in robot.shapes if s.role == "solid"), field_pairs=robot.field_pairs[:0])
    solids = replace(solids, solid_pairs=solids.solid_pairs[:0])
    world.move("ball", position=(0.9, -0.05, 0.0))
    pose = Model(solids, world).evaluate(STRETCHED)
    assert [c.kind for c in pose.contacts] == ["solid"]
    assert not pose.projection.any()


def folded() -> Pose:
    """The tip of the planar arm folded back to its second joint: the fields of links 1 and 3 overlap by 5 cm."""
    return Model(planar_arm()).evaluate(np.array([0.3, 0.7, 2.5]))


def test_both_sides_of_a_self_contact_are_driven_apart() -> None:
    pose = folded()
    (contact,) = [c for c in pose.contacts if c.kind == "field"]
    projection = pose.projection
    after = Model(planar_arm()).evaluate(pose.q + 0.01 * projection / np.linalg.norm(projection))
    (less,) = [c for c in after.contacts if c.kind == "field"]
    assert less.depth < contact.depth


def test_a_self_contact_does_not_push_the_joints_below_both_of_its_links() -> None:
    """The whole arm turning about its first joint changes nothing between links 1 and 3."""
    projection = folded().projection
    assert projection[0] == pytest.approx(0.0, abs=1e-12)
    assert projection[2] < -1e-3


def test_the_published_force_by_hand() -> None:
    """tau .005 m^2/rad: 1000 tau = 5, squared 25, 1200 * 25 / (1200 / 50 + 25) = 612.2 deg/s^2, over the norm of the part."""
    force = np.rad2deg(collision_force(np.array([0.005, 0.003, -0.004]), Gains.published_2014()))
    assert force == pytest.approx([612.2449, 0.6 * 612.2449, -0.8 * 612.2449], rel=1e-6)


@pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
def test_the_force_of_a_part_is_bounded_and_keeps_its_direction(gains: Gains) -> None:
    force = collision_force(np.array([0.0, 30.0, -40.0]), gains)
    assert force[0] == 0.0
    assert 0.9 * gains.max_contact < np.linalg.norm(force) < gains.max_contact
    assert force[1] / force[2] == pytest.approx(-0.75)


def test_the_default_force_is_linear_for_small_penetrations() -> None:
    gains = Gains.default()
    force = collision_force(np.array([1e-6, 0.0, 0.0]), gains)
    assert force[0] == pytest.approx(gains.contact_gain * 1e-6, rel=1e-3)
