# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.robot import Shape
from mobee.robot.urdf.read import UrdfOptions, read_urdf
from mobee.robot.urdf.shapes import grown
from tests.mobee.robot.urdf_files import ARM, arm_with, tetrahedron, urdf_file, write_stl

CAPSULE = (
    '<collision name="c"><origin xyz="0 0 0.1"/><geometry><cylinder radius="0.05" length="0.2"/></geometry></collision>'
    '<collision><origin xyz="0 0 0.2"/><geometry><sphere radius="{0}"/></geometry></collision>'
    '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
)


def palm(folder: Path, geometry: str, origin: str = '<origin xyz="0 0 0"/>') -> Shape:
    (shape,) = read_urdf(arm_with(folder, geometry, origin)).shapes
    return shape


@pytest.mark.parametrize(
    ("geometry", "kind", "size"),
    [
        ('<sphere radius="0.1"/>', "sphere", (0.1,)),
        ('<cylinder radius="0.1" length="0.3"/>', "cylinder", (0.1, 0.3)),
        ('<capsule radius="0.1" length="0.3"/>', "capsule", (0.1, 0.3)),
        ('<box size="0.1 0.2 0.3"/>', "box", (0.1, 0.2, 0.3)),
    ],
)
def test_primitives_keep_their_kind_and_size(tmp_path: Path, geometry: str, kind: str, size: tuple[float, ...]) -> None:
    shape = palm(tmp_path, geometry, '<origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/>')
    assert (shape.name, shape.kind, shape.size, shape.role, shape.part) == ("palm", kind, size, "solid", "all")
    assert shape.link == 2  # the fixed hand is part of the lower arm
    assert np.allclose(shape.position, [2, 0, 0.5], atol=1e-15)
    assert np.allclose(shape.rotation[:, 0], [0, 1, 0], atol=1e-15)


def test_a_cylinder_with_spheres_at_its_ends_is_a_capsule(tmp_path: Path) -> None:
    link = '<link name="hand">' + CAPSULE.format(0.05) + "</link>"
    wrist = '<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/></joint>'
    (shape,) = read_urdf(urdf_file(tmp_path, *ARM, link, wrist)).shapes
    assert (shape.name, shape.kind, shape.size) == ("c", "capsule", (0.05, 0.2))
    other = '<link name="hand">' + CAPSULE.format(0.06) + "</link>"
    assert [shape.kind for shape in read_urdf(urdf_file(tmp_path, *ARM, other, wrist)).shapes] == ["cylinder", "sphere", "sphere"]


def test_more_shapes_than_can_be_tested_are_refused(tmp_path: Path) -> None:
    ball = '<collision><geometry><sphere radius="1"/></geometry></collision>'
    wrist = '<joint name="wrist" type="fixed"><parent link="lower"/><child link="hand"/></joint>'
    with pytest.raises(RobotFileError, match=":7: <collision> size of the file: more than 2000 shapes. Join small shapes"):
        read_urdf(urdf_file(tmp_path, *ARM, f'<link name="hand">{ball * 2001}</link>', wrist))


def test_a_mesh_becomes_its_hull_about_the_hulls_middle(tmp_path: Path) -> None:
    write_stl(tmp_path / "t.stl", tetrahedron(0.1))
    shape = palm(tmp_path, '<mesh filename="t.stl" scale="2 1 -1"/>')
    assert (shape.kind, shape.size) == ("convex", ())
    assert shape.vertices is not None
    assert np.abs(shape.vertices.max(axis=0) + shape.vertices.min(axis=0)).max() < 1e-15
    corners = shape.position + shape.vertices @ shape.rotation.T
    wanted = np.array([[2, 0, 0], [2.2, 0, 0], [2, 0.1, 0], [2, 0, -0.1]])
    assert np.abs(corners[:, None] - wanted).max(axis=2).min(axis=0).max() < 1e-8  # binary STL keeps seven digits


def test_a_mesh_can_be_bounded_by_a_primitive(tmp_path: Path) -> None:
    grid = np.stack(np.meshgrid([0, 0.1], [0, 0.2], [0, 0.3]), axis=-1).reshape(-1, 3)
    write_stl(tmp_path / "b.stl", grid[np.array([[0, 1, 2], [3, 4, 5], [5, 6, 7]])])
    path = arm_with(tmp_path, '<mesh filename="b.stl"/>')
    (shape,) = read_urdf(path, UrdfOptions(meshes="bounding")).shapes
    assert shape.kind == "box"
    assert sorted(shape.size) == pytest.approx([0.1, 0.2, 0.3], abs=1e-7)
    assert np.allclose(shape.position, [2.05, 0.1, 0.15], atol=1e-7)


def test_fields_grow_around_every_solid(tmp_path: Path) -> None:
    write_stl(tmp_path / "t.stl", tetrahedron(0.1))
    for geometry in ('<sphere radius="0.1"/>', '<box size="0.1 0.2 0.3"/>', '<mesh filename="t.stl"/>'):
        solid, field = read_urdf(arm_with(tmp_path, geometry), UrdfOptions(field=0.03)).shapes
        assert (solid.name, solid.role, field.name, field.role) == ("palm", "solid", "palm_field", "field")


def surface(shape: Shape) -> np.ndarray:
    """Points of a shape that reach farthest from its middle."""
    match shape.kind:
        case "box":
            local = np.array(np.meshgrid(*[[-edge / 2, edge / 2] for edge in shape.size])).reshape(3, -1).T
        case "convex":
            assert shape.vertices is not None
            local = shape.vertices
        case _:
            raise AssertionError(shape.kind)
    return local @ shape.rotation.T + shape.position


def test_a_field_extends_by_the_given_distance() -> None:
    rotation = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    place = (np.array([1.0, 2.0, 3.0]), rotation, "solid", "all")
    assert grown(Shape("s", 1, "sphere", (0.1,), *place), 0.02, "f").size == pytest.approx((0.12,))
    assert grown(Shape("s", 1, "capsule", (0.1, 0.5), *place), 0.02, "f").size == pytest.approx((0.12, 0.5))
    assert grown(Shape("s", 1, "cylinder", (0.1, 0.5), *place), 0.02, "f").size == pytest.approx((0.12, 0.54))
    assert grown(Shape("s", 1, "box", (0.1, 0.2, 0.3), *place), 0.02, "f").size == pytest.approx((0.14, 0.24, 0.34))


def test_the_field_of_a_hull_is_a_capsule_that_holds_it_with_room_to_spare() -> None:
    vertices = np.random.default_rng(4).normal(size=(30, 3)) * [0.05, 0.02, 0.1]
    rotation = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    hull = Shape("s", 1, "convex", (), np.array([1.0, 2.0, 3.0]), rotation, "solid", "all", vertices)
    field = grown(hull, 0.02, "f")
    assert field.kind == "capsule" and field.vertices is None
    local = (surface(hull) - field.position) @ field.rotation
    beyond = np.maximum(np.abs(local[:, 2]) - field.size[1] / 2, 0.0)
    distance = np.hypot(np.hypot(local[:, 0], local[:, 1]), beyond)
    assert distance.max() <= field.size[0] - 0.02


MALFORMED = {
    "no geometry": ("", r":7: <collision> geometry: holds nothing. Write one of sphere, cylinder"),
    "unknown": ('<sfere radius="1"/>', r":7: <collision> geometry: holds sfere. Did you mean 'sphere'"),
    "two": ('<sphere radius="1"/><sphere radius="1"/>', r":7: <collision> geometry: holds sphere, sphere"),
    "no radius": ("<sphere/>", r":7: <sphere> radius: is required and missing"),
    "flat sphere": ('<sphere radius="0"/>', r":7: <sphere> radius: 0 is not positive"),
    "huge sphere": ('<sphere radius="1e6"/>', r":7: <sphere> radius: 1e\+06 m is too long"),
    "flat box": ('<box size="1 1 0"/>', r":7: <box> size: 1 1 0 is no box. Write three edges above 0"),
    "box of two": ('<box size="1 1"/>', r":7: <box> size: has 2 numbers. Write 3 numbers"),
    "endless cylinder": ('<cylinder radius="1" length="inf"/>', r":7: <cylinder> length: 'inf' is not finite"),
    "no file": ("<mesh/>", r":7: <mesh> filename: is required and missing"),
    "missing file": ('<mesh filename="nowhere.stl"/>', r":7: <mesh> filename: no mesh 'nowhere.stl' \(looked at .*nowhere.stl\)"),
    "zero scale": ('<mesh filename="t.stl" scale="1 0 1"/>', r":7: <mesh> scale: has a factor of 0"),
    "huge scale": ('<mesh filename="t.stl" scale="1e6 1 1"/>', r":7: <mesh> scale: the mesh is 100000 m long. Correct the scale"),
    "unknown mesh": ('<mesh filename="t.step"/>', r"t.step: meshes of type '.step' cannot be read. Convert it to .stl, .obj or .dae"),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_shape_is_refused_with_its_line_and_a_remedy(tmp_path: Path, name: str) -> None:
    write_stl(tmp_path / "t.stl", tetrahedron(0.1))
    (tmp_path / "t.step").write_text("?")
    geometry, message = MALFORMED[name]
    with pytest.raises(RobotFileError, match=message):
        read_urdf(arm_with(tmp_path, geometry))
