# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import mobee
from mobee.model.world_object import Geometry, WorldObject
from tests.mobee.planar import planar_arm

HALF_TURN = np.diag([-1.0, -1.0, 1.0])


@pytest.fixture
def world():
    made = mobee.World()
    made.add("cup", mobee.cylinder(0.03, 0.1), position=(0.1, 0.2, 0.3), color=(1.0, 0.0, 0.0))
    return made


def test_objects_are_listed_in_the_order_in_which_they_came(world):
    world.add("ball", mobee.sphere(0.03))
    world.move("cup", position=(0.0, 0.0, 0.0))
    assert list(world.objects) == ["cup", "ball"]
    assert world.objects["cup"].color == (1.0, 0.0, 0.0, 1.0)


def test_a_snapshot_never_changes(world):
    before, version = world.objects, world.version
    world.move("cup", position=(1.0, 1.0, 1.0), rotation=HALF_TURN)
    world.add("ball", mobee.sphere(0.03))
    world.remove("cup")
    assert list(before) == ["cup"]
    assert np.array_equal(before["cup"].position, [0.1, 0.2, 0.3])
    assert world.version == version + 3
    with pytest.raises(TypeError):
        world.objects["cup"] = before["cup"]


def test_the_callers_array_is_not_kept(world):
    place = np.array([1.0, 2.0, 3.0])
    world.move("cup", position=place)
    place[:] = 0.0
    assert np.array_equal(world.objects["cup"].position, [1.0, 2.0, 3.0])


def test_the_arrays_of_an_object_cannot_be_changed(world):
    name = next(iter(world.objects))
    for values in (world.objects[name].position, world.objects[name].rotation):
        with pytest.raises(ValueError, match="read-only"):
            values[0] = 1.0


def test_move_keeps_the_position_or_rotation_that_is_not_given(world):
    world.move("cup", rotation=HALF_TURN)
    assert np.array_equal(world.objects["cup"].position, [0.1, 0.2, 0.3])
    assert np.array_equal(world.objects["cup"].rotation, HALF_TURN)


def test_roles_change(world):
    world.set_role("cup", "target")
    assert world.objects["cup"].role == "target"


def test_names_are_unique_and_errors_name_the_nearest(world):
    with pytest.raises(mobee.InvalidValue, match="'cup' exists already"):
        world.add("cup", mobee.sphere(0.1))
    for edit in (world.remove, world.move, world.detach, lambda name: world.set_role(name, "ghost")):
        with pytest.raises(mobee.UnknownName, match="Did you mean 'cup'"):
            edit("cap")


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"position": (0.0, 0.0)}, "three finite numbers"),
        ({"position": (0.0, 0.0, float("nan"))}, "three finite numbers"),
        ({"position": "here"}, "three finite numbers"),
        ({"position": np.zeros(3, dtype=complex)}, "three finite numbers"),
        ({"position": [[0.0, 0.0], [0.0]]}, "three finite numbers"),
        ({"rotation": 2 * np.eye(3)}, "rotation matrix"),
        ({"rotation": np.full((3, 3), np.nan)}, "rotation matrix"),
        ({"rotation": "upright"}, "rotation matrix"),
        ({"rotation": np.diag([1.0, 1.0, -1.0])}, "rotation matrix"),
        ({"role": "enemy"}, "obstacle, target, ghost"),
        ({"color": (255, 0, 0)}, "each 0 to 1"),
        ({"color": "red"}, "each 0 to 1"),
        ({"color": ("1", "0", "0")}, "each 0 to 1"),
        ({"color": 0.5}, "each 0 to 1"),
        ({"mass": 0.0}, "above 0 and at most 10000 kg"),
        ({"mass": float("nan")}, "above 0 and at most 10000 kg"),
        ({"mass": 1.0, "friction": -0.1}, "coefficient of 0 to 10"),
    ],
)
def test_an_invalid_pose_role_color_or_mass_is_refused(world, given, complaint):
    with pytest.raises(mobee.InvalidValue, match=complaint):
        world.add("thing", mobee.sphere(0.1), **given)
    assert list(world.objects) == ["cup"]


@pytest.mark.parametrize("size", [(float("nan"),), (float("inf"),), (0.0,), (-0.1,), (), (0.1, 0.1), (1e160,), (1e-10,), ("1",)])
def test_a_volume_without_a_finite_size_is_refused(world, size):
    with pytest.raises(mobee.InvalidValue, match="it must be 1 lengths of 1e-09 to 100000 m"):
        world.add("thing", Geometry("sphere", size))
    assert list(world.objects) == ["cup"]


def test_attaching_needs_to_know_where_the_link_is(world):
    with pytest.raises(mobee.InvalidValue, match="call world.follow"):
        world.attach("cup", "hand")


def test_an_attached_object_moves_only_with_its_link(world):
    world.attach("cup", "hand", ((0.0, 0.0, 0.1), np.eye(3)))
    assert world.objects["cup"].link == "hand"
    with pytest.raises(mobee.InvalidValue, match="detach it first"):
        world.move("cup", position=(0.0, 0.0, 0.0))


def test_an_object_that_is_not_attached_cannot_be_detached(world):
    with pytest.raises(mobee.InvalidValue, match="not attached"):
        world.detach("cup")


@pytest.mark.parametrize("name", [3, "", None])
def test_a_name_is_text_that_is_not_empty(world, name):
    with pytest.raises(mobee.InvalidValue, match=f"{name!r}: its name must be text"):
        world.add(name, mobee.sphere(0.1))
    assert list(world.objects) == ["cup"]
    with pytest.raises(mobee.UnknownName, match="Valid: cup"):
        world.remove(name)


@pytest.mark.parametrize("shape", [0.1, "sphere", mobee.sphere])
def test_an_invalid_shape_is_refused(world, shape):
    with pytest.raises(mobee.InvalidValue, match="must be a Geometry, as sphere"):
        world.add("lamp", shape)


def test_a_place_that_is_refused_leaves_the_object_where_it_was(world):
    with pytest.raises(mobee.InvalidValue, match="three finite numbers"):
        world.move("cup", position=(float("inf"), 0.0, 0.0))
    with pytest.raises(mobee.InvalidValue, match="three finite numbers"):
        world.attach("cup", "hand", ((0.0, 0.0, float("nan")), np.eye(3)))
    assert np.array_equal(world.objects["cup"].position, [0.1, 0.2, 0.3])


class OwnWorld(mobee.World):
    pass


class OwnModel(mobee.Model):
    pass


def test_an_object_copies_the_arrays_that_it_is_made_of():
    position, rotation = np.zeros(3), np.eye(3)
    thing = WorldObject("cup", "sphere", (0.1,), position, rotation)
    position[0] = rotation[0, 0] = 5.0
    assert not thing.position.any() and np.array_equal(thing.rotation, np.eye(3))


COPIES = pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))], ids=["copy", "deepcopy", "pickle"]
)


@COPIES
def test_a_copy_of_a_subclass_is_one_too(copied):
    world = OwnWorld()
    world.add("ball", mobee.sphere(0.1))
    assert type(copied(world)) is OwnWorld and list(copied(world).objects) == ["ball"]
    assert type(copied(OwnModel(planar_arm()))) is OwnModel


@COPIES
def test_a_copy_is_a_world_of_its_own(world, copied):
    world.attach("cup", "hand", ((0.0, 0.0, 0.1), np.eye(3)))
    world.add("ball", mobee.sphere(0.1), role="target", mass=0.2)
    other = copied(world)
    assert list(other.objects) == list(world.objects) == ["cup", "ball"]
    assert (other.objects["cup"].link, other.objects["ball"].role, other.objects["ball"].mass) == ("hand", "target", 0.2)
    assert other.snapshot.rows.tobytes() == world.snapshot.rows.tobytes() and other.snapshot.attached == ("cup",)
    with pytest.raises(ValueError, match="read-only"):
        other.objects["ball"].position[0] = 1.0
    other.remove("ball")
    world.move("ball", position=(1.0, 0.0, 0.0))
    assert "ball" in world.objects and "ball" not in other.objects
