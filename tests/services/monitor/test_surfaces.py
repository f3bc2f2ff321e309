# SPDX-License-Identifier: Apache-2.0
"""The triangles of the page's own 3D view."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from mobee.arrays import Array
from mobee.rendering.solid import Solid
from mobee.robot.load import load_robot
from mobee.robot.robot import ShapeKind
from services.monitor.web.surfaces import BUDGET, MAKERS, surfaces_of

SIZES: dict[ShapeKind, tuple[float, ...]] = {"sphere": (0.1,), "capsule": (0.1, 0.4), "cylinder": (0.1, 0.4), "box": (0.1, 0.2, 0.3)}
VOLUMES = {"sphere": np.pi * 4e-3 / 3, "capsule": np.pi * (4e-3 / 3 + 4e-3), "cylinder": np.pi * 4e-3, "box": 6e-3}


def volume(vertices: Array, triangles: Array) -> float:
    """Of a closed surface whose triangles are anticlockwise as seen from outside."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return float((a * np.cross(b, c)).sum() / 6.0)


@pytest.mark.parametrize("kind", SIZES)
def test_a_volume_is_closed_and_its_triangles_face_outwards(kind: ShapeKind) -> None:
    vertices, normals, triangles = MAKERS[kind](Solid(kind, SIZES[kind], np.zeros(3), np.eye(3), (0.5, 0.5, 0.5)))
    assert volume(vertices, triangles) == pytest.approx(VOLUMES[kind], rel=0.05)  # of twenty corners around
    assert ((vertices * normals).sum(axis=1) >= -1e-12).all()
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)


def test_the_page_reads_what_is_encoded() -> None:
    robot = load_robot("katana")
    data = surfaces_of(robot)()
    (length,) = struct.unpack_from("<I", data)
    header, at = json.loads(data[4 : 4 + length]), 4 + length
    assert [one["link"] for one in header] == [shape.link for shape in robot.shapes if shape.role == "solid"]
    for one, shape in zip(header, (shape for shape in robot.shapes if shape.role == "solid"), strict=True):
        vertices = np.frombuffer(data, "<f4", 3 * one["vertices"], at).reshape(-1, 3)
        at += 24 * one["vertices"]
        triangles = np.frombuffer(data, "<u4", 3 * one["triangles"], at).reshape(-1, 3)
        at += 12 * one["triangles"]
        assert triangles.max() < len(vertices)
        np.testing.assert_allclose((vertices.min(axis=0) + vertices.max(axis=0)) / 2.0, shape.position, atol=1e-6)
    assert at == len(data)


def test_the_meshes_that_a_file_draws_are_sent_coarser_and_its_solids_are_not() -> None:
    pytest.importorskip("trimesh")
    robot = load_robot("icub")
    data = surfaces_of(robot)()
    (length,) = struct.unpack_from("<I", data)
    header = json.loads(data[4 : 4 + length])
    assert {one["link"] for one in header} == {visual.link for visual in robot.visuals}
    assert 5000 < sum(one["triangles"] for one in header) < 2 * BUDGET
    assert len(data) == 4 + length + sum(24 * one["vertices"] + 12 * one["triangles"] for one in header)
