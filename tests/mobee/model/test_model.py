# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import copy
import pickle
import threading
import time
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

import mobee
from mobee.model.kinematics import link_transforms
from tests.mobee.planar import FIELD, LENGTH, RADIUS, planar_arm

STRETCHED = np.zeros(3)
FOLDED = np.array([0.0, np.deg2rad(150), np.deg2rad(150)])  # the third segment comes back over the first
TIP = 3 * LENGTH


@pytest.fixture
def model():
    return mobee.Model(planar_arm())


def _names(pose):
    return [(c.kind, c.first, c.second) for c in pose.contacts]


def test_markers_are_where_trigonometry_says(model):
    pose = model.evaluate([np.pi / 2, 0.0, 0.0])
    assert pose.position("tip") == pytest.approx([0.0, TIP, 0.0], abs=1e-15)
    assert pose.normal("tip") == pytest.approx([0.0, 1.0, 0.0], abs=1e-15)
    assert pose.rotation("tip") == pytest.approx(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]), abs=1e-15)


def test_a_marker_moves_as_its_jacobian_says(model, rng):
    q = rng.uniform(-2, 2, 3)
    jacobian = model.jacobian(q, "tip")
    step = 1e-6 * rng.normal(size=3)
    moved = model.evaluate(q + step).position("tip") - model.evaluate(q - step).position("tip")
    assert jacobian[:3] @ (2 * step) == pytest.approx(moved, abs=1e-14)
    assert jacobian[3:] == pytest.approx(np.outer([0.0, 0.0, 1.0], np.ones(3)), abs=1e-15)
    pose = model.evaluate(q)
    assert pose.point_jacobian(3, pose.position("tip")) == pytest.approx(jacobian, abs=1e-15)


def test_batches_equal_their_poses_one_by_one(model, rng):
    model.world.add("wall", mobee.box(0.1, 2.0, 1.0), position=(0.7, 0.0, 0.0))
    q = rng.uniform(-3, 3, (5, 4, 3))
    batch = model.evaluate(q)
    jacobian = model.jacobian(q, "tip")
    assert batch.count.shape == (5, 4)
    assert batch.count.max() > 0
    for index in np.ndindex(5, 4):
        one = model.evaluate(q[index])
        assert batch.count[index] == one.count
        assert batch.position("tip")[index] == pytest.approx(one.position("tip"), abs=1e-15)
        assert batch.rotation("tip")[index] == pytest.approx(one.rotation("tip"), abs=1e-15)
        assert jacobian[index] == pytest.approx(model.jacobian(q[index], "tip"), abs=1e-15)


def test_the_arm_has_contacts_of_its_tested_pairs(model):
    assert model.evaluate(STRETCHED).contacts == ()
    pose = model.evaluate(FOLDED)
    assert _names(pose) == [("solid", "segment0", "segment2"), ("field", "field0", "field2")]
    assert [(c.first_link, c.second_link) for c in pose.contacts] == [(1, 3), (1, 3)]
    assert pose.contacts[0].depth == pytest.approx(2 * RADIUS, abs=1e-12)  # their axes cross
    assert np.abs(pose.contacts[0].normal) == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_solids_touch_solidly_and_fields_touch_as_fields(model):
    model.world.add("ball", mobee.sphere(0.03), position=(TIP + 0.1, 0.0, 0.0))
    (field,) = model.evaluate(STRETCHED).contacts
    assert (field.kind, field.first, field.second, field.first_link, field.second_link) == ("field", "field2", "ball", 3, -1)
    assert field.depth == pytest.approx(FIELD + 0.03 - 0.1, abs=1e-12)
    assert field.normal == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)
    assert model.evaluate(STRETCHED).count == 0
    model.world.move("ball", position=(TIP + 0.07, 0.0, 0.0))
    pose = model.evaluate(STRETCHED)
    assert _names(pose) == [("solid", "segment2", "ball"), ("field", "field2", "ball")]
    assert pose.contacts[0].depth == pytest.approx(RADIUS + 0.03 - 0.07, abs=1e-12)
    assert pose.count == 1


def test_the_base_stands_on_its_table(model):
    model.world.add("table", mobee.box(1.0, 1.0, 0.1), position=(-0.3, 0.0, -0.25))
    assert model.evaluate(STRETCHED).contacts == ()
    without = replace(planar_arm(), base_shapes=frozenset())
    assert _names(mobee.Model(without, model.world).evaluate(STRETCHED)) == [("solid", "post", "table")]


def test_ghosts_have_no_contacts(model):
    model.world.add("ghost", mobee.sphere(0.1), position=(TIP, 0.0, 0.0), role="ghost")
    assert model.evaluate(STRETCHED).contacts == ()
    model.world.set_role("ghost", "obstacle")
    assert model.evaluate(STRETCHED).count == 1


def test_only_the_reaching_link_spares_the_target(model):
    model.world.add("ball", mobee.sphere(0.1), position=(0.62, 0.0, 0.0), role="target")
    everything = {"segment1", "segment2", "field1"}
    assert {c.first for c in model.evaluate(STRETCHED).contacts} == everything
    assert {c.first for c in model.evaluate(STRETCHED, reaching="tip").contacts} == everything - {"segment2"}
    assert {c.first for c in model.evaluate([STRETCHED], reaching=["tip"]).table.contacts()} == everything - {"segment2"}
    assert {c.first for c in model.evaluate(STRETCHED).contacts} == everything
    model.world.set_role("ball", "obstacle")
    assert {c.first for c in model.evaluate(STRETCHED, reaching="tip").contacts} == everything


def test_reaching_wants_a_marker_of_the_robot(model):
    with pytest.raises(mobee.UnknownName, match="Did you mean 'tip'"):
        model.evaluate(STRETCHED, reaching="top")
    with pytest.raises(mobee.InvalidValue, match="3 markers reach at once"):
        model.evaluate(STRETCHED, reaching=("tip", "tip", "tip"))


def test_contacts_come_in_the_same_order_every_time(model, rng):
    for i in range(20):
        model.world.add(f"box{i}", mobee.box(0.1, 0.1, 0.1), position=rng.uniform(-0.5, 1.0, 3) * [1.0, 1.0, 0.1])
    order = {name: i for i, name in enumerate([s.name for s in model.robot.shapes] + list(model.world.objects))}
    keys = [(c.kind == "field", order[c.first], order[c.second]) for c in model.evaluate(FOLDED).contacts]
    assert len(keys) > 3
    assert keys == sorted(keys)


def test_an_attached_object_moves_with_the_link_and_does_not_touch_it(model):
    model.world.add("cup", mobee.sphere(0.04), position=(TIP + 0.08, 0.0, 0.0))
    model.world.follow(model.evaluate(STRETCHED))
    model.world.attach("cup", "link3")
    turned = model.evaluate([np.pi / 2, 0.0, 0.0])
    assert turned.objects["cup"].position == pytest.approx([0.0, TIP + 0.08, 0.0], abs=1e-15)
    assert turned.contacts == ()
    model.world.follow(turned)
    model.world.detach("cup")
    assert model.world.objects["cup"].link is None
    assert model.world.objects["cup"].position == pytest.approx([0.0, TIP + 0.08, 0.0], abs=1e-15)
    assert _names(model.evaluate(STRETCHED)) == []
    assert _names(model.evaluate([np.pi / 2, 0.0, 0.0])) == [("solid", "segment2", "cup"), ("field", "field2", "cup")]


def test_a_carried_object_has_contacts_with_the_other_links(model):
    model.world.add("cup", mobee.sphere(0.04), position=(TIP, 0.12, 0.0))
    model.attach("cup", "link3", STRETCHED)
    triangle = [0.0, np.deg2rad(120), np.deg2rad(120)]  # the tip is back at the first joint, the cup below the first segment
    solid = [c for c in model.evaluate(triangle).contacts if c.kind == "solid" and c.second == "cup"]
    assert [c.first for c in solid] == ["segment0"]
    assert solid[0].depth == pytest.approx(RADIUS + 0.04 - 0.12 * np.sin(np.deg2rad(30)), abs=1e-12)


def test_an_evaluation_changes_nothing(model):
    model.world.add("cup", mobee.sphere(0.04), position=(TIP, 0.0, 0.0))
    model.world.follow(model.evaluate(STRETCHED))
    version = model.world.version
    for q in (FOLDED, [FOLDED, STRETCHED]):
        model.evaluate(q, reaching="tip")
        model.track().evaluate(q)
    assert model.world.version == version
    model.world.attach("cup", "link3")
    assert model.world.objects["cup"].position == pytest.approx([TIP, 0.0, 0.0], abs=1e-15)  # as in the pose that the world follows


def test_attach_in_a_given_pose_does_not_need_the_one_that_the_world_follows(model):
    model.world.add("cup", mobee.sphere(0.04), position=(0.0, TIP, 0.0))
    model.world.follow(model.evaluate(FOLDED))
    model.attach("cup", "link3", [np.pi / 2, 0.0, 0.0])
    assert model.evaluate(STRETCHED).objects["cup"].position == pytest.approx([TIP, 0.0, 0.0], abs=1e-15)


def test_an_object_is_not_attached_at_a_batch_of_poses(model):
    model.world.add("cup", mobee.sphere(0.04))
    with pytest.raises(mobee.InvalidValue, match=r"q has shape \(2, 3\); an object is attached at one pose, \(3,\) rad"):
        model.attach("cup", "link3", [FOLDED, STRETCHED])


def test_attach_names_the_nearest_link_and_object(model):
    model.world.add("cup", mobee.sphere(0.04))
    model.world.follow(model.evaluate(STRETCHED))
    with pytest.raises(mobee.UnknownName, match="unknown link 'link4'. Did you mean"):
        model.world.attach("cup", "link4")
    with pytest.raises(mobee.UnknownName, match="unknown world object 'cap'. Did you mean 'cup'"):
        model.attach("cap", "link3", STRETCHED)


@pytest.mark.parametrize("engine", ["compiled", "fcl"])
def test_an_object_attached_to_an_unknown_link_is_refused_by_name(model, engine):
    world = model.world
    for name in ("cup", "ball"):
        world.add(name, mobee.sphere(0.04))
    world.attach("ball", "tail", ((0.0, 0.0, 0.0), np.eye(3)))
    other = mobee.Model(model.robot, world, engine=engine)
    for ask in (
        lambda: other.evaluate(STRETCHED).contacts,
        lambda: other.evaluate(STRETCHED).objects,
        lambda: other.attach("cup", "link3", STRETCHED),
    ):
        with pytest.raises(mobee.UnknownName, match="unknown link 'tail'"):
            ask()


@pytest.mark.parametrize(
    ("q", "complaint"),
    [
        (np.zeros(4), r"shape \(4,\).*has 3 motors, so it must be \(3,\)"),
        (0.0, r"shape \(\).*has 3 motors"),
        ("home", r"q is 'home'; it must be an array of numbers"),
        ([[0.0, 0.0, 0.0], [0.0]], "must be an array of numbers"),
        (np.zeros(3, dtype=complex), "q is complex"),
        ([1j, 0.0, 0.0], "q is complex"),
        ([0.0, np.nan, 0.0], "motor 'm1' is nan"),
        (np.array([[0.0, 0.0, 0.0], [0.0, 0.0, np.inf]]), "motor 'm2' is inf"),
    ],
)
def test_an_invalid_configuration_is_refused(model, q, complaint):
    with pytest.raises(mobee.InvalidValue, match=complaint):
        model.evaluate(q)


def test_contacts_of_a_batch_are_refused(model):
    with pytest.raises(mobee.InvalidValue, match="use table"):
        _ = model.evaluate(np.zeros((2, 3))).contacts


def test_the_callers_q_is_not_kept(model):
    q = np.zeros(3)
    pose = model.evaluate(q)
    q[:] = 1.0
    assert not pose.q.any()


def test_a_pose_keeps_the_world_in_which_it_was_evaluated(model):
    model.world.add("ball", mobee.sphere(0.1), position=(TIP, 0.0, 0.0))
    pose = model.evaluate(STRETCHED)
    model.world.remove("ball")
    assert pose.count == 1
    assert list(pose.objects) == ["ball"]
    assert model.evaluate(STRETCHED).count == 0


def test_a_robot_without_shapes_touches_nothing(model):
    bare = replace(model.robot, shapes=(), solid_pairs=np.empty((0, 2), np.intp), field_pairs=np.empty((0, 2), np.intp))
    model.world.add("ball", mobee.sphere(0.1), position=(TIP, 0.0, 0.0))
    assert mobee.Model(bare, model.world).evaluate(np.zeros((2, 3))).count.tolist() == [0, 0]


def test_transforms_are_those_of_the_kinematics(model):
    assert model.evaluate(FOLDED).transforms == pytest.approx(link_transforms(model.robot, FOLDED), abs=1e-15)


def test_every_evaluation_sees_one_world_while_another_thread_floods_it(model):
    """The thesis' algorithm 1: objects come and go without waiting, in pairs that no evaluation may see torn."""
    world, stop = model.world, threading.Event()
    failures: list[Exception] = []

    def flood(rng: np.random.Generator) -> None:
        try:
            while not stop.is_set():
                for i in range(10):
                    world.add(f"box{i}", mobee.box(*rng.uniform(0.05, 0.2, 3)), position=(TIP, 0.0, 0.0))
                for i in range(10):
                    world.move(f"box{i}", position=(TIP, 0.0, rng.uniform(-0.02, 0.02)))
                for i in range(10):
                    world.remove(f"box{i}")
        except Exception as error:  # handed to the main thread, which asserts that there is none
            failures.append(error)

    thread = threading.Thread(target=flood, args=(np.random.default_rng(1),))
    thread.start()
    counts = set()
    try:
        for _ in range(300):
            time.sleep(1e-4)  # lets the other thread have its turn
            pose = model.evaluate(STRETCHED)
            boxes = [name for name in pose.objects if name.startswith("box")]
            touched = [c.second for c in pose.contacts if c.kind == "solid"]
            assert sorted(touched) == sorted(boxes)  # every box encloses the tip, so each is in exactly one contact
            assert pose.count == len(boxes)
            counts.add(len(boxes))
    finally:
        stop.set()
        thread.join()
    assert failures == []
    assert len(counts) > 2  # the world did change under the evaluations


@pytest.mark.parametrize(("robot", "world", "complaint"), [("icub", None, "robot is 'icub'"), (None, "table", "world is 'table'")])
def test_a_name_in_place_of_a_robot_or_world_is_refused(model, robot, world, complaint):
    with pytest.raises(mobee.InvalidValue, match=complaint):
        mobee.Model(robot or model.robot, world)


@pytest.mark.parametrize("engine", ["compiled", "fcl"])
def test_a_model_can_be_copied_and_pickled(engine: Literal["compiled", "fcl"]) -> None:
    model = mobee.Model(planar_arm(), engine=engine)
    model.world.add("ball", mobee.sphere(0.2), position=(0.5, 0.1, 0.0))
    wanted = model.evaluate(np.zeros(3)).table
    assert len(wanted)
    for other in (copy.copy(model), copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert np.array_equal(other.evaluate(np.zeros(3)).table.reals, wanted.reals)
        assert type(other._engine) is type(model._engine)
    assert copy.copy(model).world is model.world and copy.deepcopy(model).world is not model.world
