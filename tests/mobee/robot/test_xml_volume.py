# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.robot.xml.node import Node
from mobee.robot.xml.volume import Y, align, read_volume, turn_about

angles = st.floats(-np.pi, np.pi)


def unit(azimuth: float, height: float) -> Array:
    ring = np.sqrt(1 - height**2)
    return np.array([ring * np.cos(azimuth), ring * np.sin(azimuth), height])


units = st.builds(unit, angles, st.floats(-1, 1))


def box(**attributes: str) -> Array:
    node = Node(Path("toy.xml"), 1, "box", {"width": "1", "height": "2", "depth": "3"} | attributes)
    return read_volume(node).rotation


@given(units, units)
def test_align_is_the_rotation_between_two_directions(source: Array, target: Array) -> None:
    rotation = align(source, target)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(rotation @ source, target, atol=1e-6)


def test_align_turns_opposite_directions_by_half_a_turn() -> None:
    for axis in np.eye(3):
        np.testing.assert_allclose(align(axis, -axis) @ axis, -axis, atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(align(axis, -axis)), 1)


def test_width_height_and_depth_of_a_box_are_along_x_y_and_z() -> None:
    node = Node(Path("toy.xml"), 1, "box", {"width": "1", "height": "2", "depth": "3", "px": "4"})
    volume = read_volume(node)
    assert volume.size == (1, 2, 3)
    np.testing.assert_array_equal(volume.centre, [4, 0, 0])
    np.testing.assert_array_equal(volume.rotation, np.eye(3))


@given(units, st.floats(-180, 180))
def test_the_height_of_a_box_is_along_h_for_every_angle(h: Array, angle: float) -> None:
    given_h = {name: repr(float(value)) for name, value in zip(("hx", "hy", "hz"), h, strict=True)}
    rotation = box(**given_h, angle=repr(angle))
    np.testing.assert_allclose(rotation @ Y, h, atol=1e-6)
    np.testing.assert_allclose(rotation, turn_about(h / np.linalg.norm(h), np.deg2rad(angle)) @ box(**given_h), atol=1e-9)


def test_the_chest_boxes_of_2014_are_turned_as_published() -> None:
    rotation = box(hz="1", angle="15")
    np.testing.assert_allclose(rotation, [[-0.258819, 0, 0.965926], [0.965926, 0, 0.258819], [0, 1, 0]], atol=1e-6)


def test_a_cylinder_is_along_y_by_default() -> None:
    attributes = {"radius": "0.1", "height": "1"}
    upright = read_volume(Node(Path("toy.xml"), 1, "cylinder", attributes))
    np.testing.assert_allclose(upright.rotation[:, 2], [0, 1, 0], atol=1e-12)
    lying = read_volume(Node(Path("toy.xml"), 1, "cylinder", attributes | {"hx": "-2"}))
    np.testing.assert_allclose(lying.rotation[:, 2], [-1, 0, 0], atol=1e-12)
