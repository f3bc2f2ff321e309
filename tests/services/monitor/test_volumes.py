# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mobee.robot.robot import ShapeKind

rr = pytest.importorskip("rerun")
from services.monitor.viewer.figure import drawn, recolored  # noqa: E402  # only where Rerun is

TURN = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # z to x
PLACE = np.array([1.0, 2.0, 3.0])
RED = (255, 0, 0, 100)
SIZES: dict[str, tuple[float, ...]] = {"sphere": (0.1,), "capsule": (0.1, 0.4), "cylinder": (0.1, 0.4), "box": (0.1, 0.2, 0.3)}


def values(component: Any) -> Any:
    return component.as_arrow_array().to_pylist()


@pytest.mark.parametrize(
    ("kind", "archetype"), [("sphere", "Ellipsoids3D"), ("capsule", "Capsules3D"), ("cylinder", "Cylinders3D"), ("box", "Boxes3D")]
)
def test_every_primitive_is_drawn_in_its_own_form(kind: ShapeKind, archetype: str) -> None:
    body = drawn(kind, SIZES[kind], PLACE, TURN, RED)
    assert type(body).__name__ == archetype
    assert type(recolored(kind, RED)).__name__ == archetype
    assert values(body.colors) == [0xFF000064]


def test_a_capsule_is_drawn_from_one_end() -> None:
    body = drawn("capsule", (0.1, 0.4), PLACE, TURN, RED)
    np.testing.assert_allclose(values(body.translations), [[0.8, 2.0, 3.0]], atol=1e-6)
    assert values(body.lengths) == [pytest.approx(0.4)]


def test_a_hull_is_a_mesh_whose_faces_look_outwards() -> None:
    cube = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
    body = drawn("convex", (), PLACE, TURN, RED, np.vstack([cube, np.zeros((1, 3))]))
    corners, normals = np.array(values(body.vertex_positions)), np.array(values(body.vertex_normals))
    assert len(corners) == 12 * 3
    np.testing.assert_allclose(np.abs(corners - PLACE).max(axis=1), 0.1, atol=1e-6)
    np.testing.assert_allclose(((corners - PLACE) * normals).sum(axis=1), 0.1, atol=1e-6)
