# SPDX-License-Identifier: Apache-2.0
"""An object that a link carries has contacts like a shape of that link."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mobee
from mobee.model.pose import touched, touched_by
from tests.mobee.planar import LENGTH, planar_arm

HAND = (3 * LENGTH, 0.0, 0.0)  # the arm is stretched
FOLDED = np.array([0.0, np.deg2rad(150), np.deg2rad(150)])  # the third segment comes back over the first


@pytest.fixture
def model() -> mobee.Model:
    made = mobee.Model(planar_arm())
    made.world.add("tool", mobee.sphere(0.04), position=HAND)
    made.attach("tool", "link3", np.zeros(3))
    return made


def names(pose: mobee.Pose) -> set[tuple[str, str, str]]:
    return {(c.kind, c.first, c.second) for c in pose.contacts if "tool" in (c.first, c.second)}


@pytest.mark.parametrize("poses", [(1, 3), (4, 3), (2, 2, 3)])
def test_a_batch_of_poses_has_no_place_for_it(model: mobee.Model, poses: tuple[int, ...]) -> None:
    batch = model.evaluate(np.zeros(poses))
    for read in (lambda: batch.objects, lambda: touched(batch), lambda: touched_by(batch, "arm")):
        with pytest.raises(mobee.InvalidValue, match="a batch of poses, of shape"):
            read()
    model.world.follow(batch)
    with pytest.raises(mobee.InvalidValue, match="a batch of poses, of shape"):
        model.world.detach("tool")


def test_it_does_not_touch_its_own_link(model: mobee.Model) -> None:
    assert names(model.evaluate(np.zeros(3))) == set()


def test_it_touches_the_shapes_of_other_links_solids_and_fields_alike(model: mobee.Model) -> None:
    turned = np.array([0.0, np.pi / 2, 2.6])  # beside the second segment's end, where the second field is
    model.world.detach("tool")
    model.world.attach("tool", "link3", ((2 * LENGTH, 0.1, 0.0), np.eye(3)))
    found = names(model.evaluate(np.zeros(3))) | names(model.evaluate(turned))
    assert ("field", "field1", "tool") in found
    assert all(second == "tool" for _, _, second in found)


def test_it_touches_the_first_segment_when_the_arm_folds(model: mobee.Model) -> None:
    model.world.detach("tool")
    model.world.attach("tool", "link3", ((2.5 * LENGTH, 0.0, 0.0), np.eye(3)))
    contacts = [c for c in model.evaluate(FOLDED).contacts if c.second == "tool"]
    assert ("solid", "segment0", 1, 3) in {(c.kind, c.first, c.first_link, c.second_link) for c in contacts}


def test_it_spares_links_that_its_own_is_not_tested_against() -> None:
    robot = replace(planar_arm(), untested={frozenset((1, 3)): "for a reason"})
    model = mobee.Model(robot)
    model.world.add("tool", mobee.sphere(0.04))
    model.world.attach("tool", "link3", ((2.5 * LENGTH, 0.0, 0.0), np.eye(3)))
    assert "segment0" not in {first for _, first, _ in names(model.evaluate(FOLDED))}


def test_it_touches_free_objects_as_a_solid_of_its_link(model: mobee.Model) -> None:
    model.world.add("wall", mobee.box(0.02, 1.0, 1.0), position=(3 * LENGTH + 0.03, 0.0, 0.0))
    contact = next(c for c in model.evaluate(np.zeros(3)).contacts if c.first == "tool")
    assert (contact.kind, contact.second, contact.first_link, contact.second_link) == ("solid", "wall", 3, -1)
    assert contact.depth == pytest.approx(0.02, abs=1e-12)
    assert contact.normal == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)


def test_two_on_two_links_touch_each_other_and_two_on_one_do_not(model: mobee.Model) -> None:
    model.world.add("other", mobee.sphere(0.04))
    model.world.attach("other", "link3", (HAND, np.eye(3)))
    assert names(model.evaluate(np.zeros(3))) == set()
    model.world.attach("other", "link1", (HAND, np.eye(3)))
    assert ("solid", "tool", "other") in names(model.evaluate(np.zeros(3)))


def test_a_ghost_in_the_hand_touches_nothing(model: mobee.Model) -> None:
    model.world.set_role("tool", "ghost")
    model.world.add("wall", mobee.box(0.1, 1.0, 1.0), position=HAND)
    assert names(model.evaluate(np.zeros(3))) == set()


def test_while_its_link_reaches_it_spares_the_targets(model: mobee.Model) -> None:
    model.world.add("goal", mobee.sphere(0.02), position=HAND, role="target")
    assert ("solid", "tool", "goal") in names(model.evaluate(np.zeros(3)))
    assert names(model.evaluate(np.zeros(3), reaching="tip")) == set()
    model.world.set_role("goal", "obstacle")
    assert ("solid", "tool", "goal") in names(model.evaluate(np.zeros(3), reaching="tip"))
