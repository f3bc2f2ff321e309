# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.robot.xml.body import read_convex
from mobee.robot.xml.node import Node
from mobee.robot.xml.read import read_robot
from tests.mobee.robot.robot_files import robot_file

TETRAHEDRON = "0 0 0  .1 0 0  0 .2 0  0 0 .3"


def convex(points: str, **attributes: str) -> Node:
    return Node(Path("toy.xml"), 7, "convex", {"points": points} | attributes)


def test_a_convex_keeps_its_points_in_its_own_axes() -> None:
    volume = read_convex(convex(TETRAHEDRON, px="1", hz="1", angle="90"))
    assert (volume.kind, volume.size) == ("convex", ())
    np.testing.assert_allclose(volume.vertices, [[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
    np.testing.assert_allclose(volume.centre, [1, 0, 0])
    np.testing.assert_allclose(volume.rotation @ [0, 1, 0], [0, 0, 1], atol=1e-12)  # turned as a box with these attributes is
    np.testing.assert_allclose(volume.rotation @ [0, 0, 1], [0, 1, 0], atol=1e-12)


def test_a_robot_carries_a_convex_solid_and_a_convex_field(tmp_path: Path) -> None:
    robot = read_robot(
        robot_file(
            tmp_path,
            '<bodypart name="arm"><motor name="m" minPos="0" maxPos="1"><joint z="1"><link x="2"><link>',
            f'<convex name="a" points="{TETRAHEDRON}" py="1"/><CONVEX points="{TETRAHEDRON}" field="true"/>',
            "</link></link></joint></motor></bodypart>",
        )
    )
    solid, field = robot.shapes
    assert [(shape.kind, shape.size, shape.role, shape.link) for shape in robot.shapes] == [
        ("convex", (), r, 1) for r in ("solid", "field")
    ]
    np.testing.assert_allclose(solid.position, [2, 1, 0])
    assert field.vertices is not None and field.vertices.shape == (4, 3)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ("0 0 0 1 0 0 0 1 0", "has 9 numbers. Write x y z of 4 to 10000 points"),
        (TETRAHEDRON + " 1", "has 13 numbers"),
        ("0 0 0 1 0 0 0 1 0 1 1 0", "all lie in one plane"),
        ("1 1 1 " * 4, "all lie in one plane"),
        ("0 0 0 1 0 0 0 1 0 1 1 1e-8", "all lie in one plane"),
        (TETRAHEDRON + " 0 0 0" * 9997, "has 30003 numbers"),
        (TETRAHEDRON + " 1 2 nan", "'nan' is not finite"),
    ],
)
def test_points_without_a_volume_are_refused(points: str, message: str) -> None:
    with pytest.raises(RobotFileError, match=f"toy.xml:7: <convex> points: {message}"):
        read_convex(convex(points))


@pytest.mark.parametrize("version", ["0.1", "1.0", "2.0"])
def test_points_without_a_volume_are_refused_in_files_of_every_version(tmp_path: Path, version: str) -> None:
    path = tmp_path / "toy.xml"
    path.write_text(
        f'<ZeroPositionKinematicTree version="{version}"><bodyPart name="a"><motor name="m" minPos="-10" maxPos="10" home="0"/>'
        '<joint motor="m" minPos="-10" maxPos="10" x="1"><link length="0.2" x="1">\n'
        '<convex points="0 0 0 1 0 0 0 1 0 0" hx="1" hy="0.3" hz="0.5" angle="30"/></link></joint></bodyPart></ZeroPositionKinematicTree>'
    )
    with pytest.raises(RobotFileError, match="toy.xml:2: <convex> points: has 10 numbers"):
        read_robot(path)
