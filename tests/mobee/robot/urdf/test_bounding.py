# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.robot.urdf.hull import Primitive, bounding_sphere, smallest, smallest_capsule


def outside(points: np.ndarray, primitive: Primitive) -> float:
    """How far the farthest point lies outside."""
    local = (points - primitive.centre) @ primitive.rotation
    off, along = np.hypot(local[:, 0], local[:, 1]), np.abs(local[:, 2])
    match primitive.kind:
        case "sphere":
            return float((np.linalg.norm(local, axis=1) - primitive.size[0]).max())
        case "capsule":
            return float((np.hypot(off, np.maximum(along - primitive.size[1] / 2, 0)) - primitive.size[0]).max())
        case "cylinder":
            return float(max((off - primitive.size[0]).max(), (along - primitive.size[1] / 2).max()))
        case _:
            return float((np.abs(local) - np.array(primitive.size) / 2).max())


def turned(seed: int) -> np.ndarray:
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return rotation * np.linalg.det(rotation)


@given(st.integers(0, 2**32 - 1), st.integers(1, 60), st.sampled_from([0.01, 1.0]))
def test_every_primitive_holds_all_points(seed: int, count: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    points = size * rng.normal(size=(count, 3)) * rng.uniform(0.0, 1.0, size=3) + rng.normal(size=3)
    for primitive in (smallest(points), smallest_capsule(points), bounding_sphere(points)):
        assert outside(points, primitive) <= 1e-12
        assert np.abs(primitive.rotation @ primitive.rotation.T - np.eye(3)).max() < 1e-12
        assert np.linalg.det(primitive.rotation) > 0
        assert min(primitive.size) > 0


def test_points_of_a_primitive_are_bounded_by_this_primitive() -> None:
    rng = np.random.default_rng(6)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    ball = 0.2 * directions + [1, 2, 3]
    assert smallest(ball).kind == "sphere"
    assert smallest(ball).size[0] == pytest.approx(0.2, rel=0.01)
    rotation = turned(7)
    rod = 0.05 * directions + np.where(rng.random(2000) < 0.5, 0.3, -0.3)[:, None] * [0, 0, 1]
    capsule = smallest(rod @ rotation.T)
    assert capsule.kind == "capsule"
    assert capsule.size == pytest.approx((0.05, 0.6), rel=0.03)
    angle = rng.uniform(0, 7, 500)
    disc = np.stack([np.cos(angle), np.sin(angle), rng.choice([-0.1, 0.1], 500)], axis=1)
    assert smallest(disc @ rotation.T).kind == "cylinder"
    box = np.array(np.meshgrid([0, 1.0], [0, 2.0], [0, 3.0])).reshape(3, -1).T
    assert smallest(box @ rotation.T).kind == "box"
    assert sorted(smallest(box @ rotation.T).size) == pytest.approx([1, 2, 3], abs=1e-6)
