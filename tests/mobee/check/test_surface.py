# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.check.shapes import outside, surface
from mobee.robot.robot import Shape

TURN = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, -0.8], [0.8, 0.0, 0.6]])
CUBE = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
SHAPE = Shape("shape", 0, "sphere", (0.1,), np.array([1.0, 2.0, 3.0]), TURN, "solid", "arm")
SHAPES = [
    SHAPE,
    replace(SHAPE, kind="capsule", size=(0.1, 0.3)),
    replace(SHAPE, kind="cylinder", size=(0.1, 0.3)),
    replace(SHAPE, kind="box", size=(0.1, 0.2, 0.3)),
    replace(SHAPE, kind="convex", size=(), vertices=CUBE),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_points_of_the_surface_are_at_the_surface(shape: Shape) -> None:
    points = surface(shape)
    np.testing.assert_allclose(outside(shape, points), 0.0, atol=1e-12)
    away = shape.position + 1.01 * (points - shape.position)
    assert (outside(shape, away) > 1e-5).all()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_a_point_beyond_is_as_far_outside_as_it_is_moved_along_the_axis(shape: Shape) -> None:
    top = {"sphere": 0.1, "capsule": 0.25, "cylinder": 0.15, "box": 0.15, "convex": 0.1}[shape.kind]
    point = shape.position + shape.rotation[:, 2] * (top + 0.2)
    assert outside(shape, point[None])[0] == pytest.approx(0.2, rel=0.05 if shape.kind == "convex" else 1e-9)
