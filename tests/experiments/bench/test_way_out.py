from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.bench.collision_peers import Place, reach, way_out
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Shape

X, Z, ALONG = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]), np.ones(3) / np.sqrt(3.0)
UPRIGHT: Place = np.zeros(3), np.eye(3)


def volume(geometry: mobee.Geometry) -> WorldObject:
    return WorldObject("it", geometry.kind, geometry.size, *UPRIGHT)


@pytest.mark.parametrize(
    ("geometry", "along_x", "along_z", "along"),
    [
        (mobee.sphere(0.2), 0.2, 0.2, 0.2),
        (mobee.capsule(0.2, 1.0), 0.2, 0.7, 0.2 + 0.5 / np.sqrt(3.0)),
        (mobee.cylinder(0.2, 1.0), 0.2, 0.5, (0.2 * np.sqrt(2.0) + 0.5) / np.sqrt(3.0)),
        (mobee.box(0.2, 0.4, 0.6), 0.1, 0.3, 0.6 / np.sqrt(3.0)),
    ],
    ids=lambda value: value.kind if isinstance(value, mobee.Geometry) else "",
)
def test_how_far_volumes_reach(geometry: mobee.Geometry, along_x: float, along_z: float, along: float) -> None:
    one = volume(geometry)
    assert [reach(one, UPRIGHT, direction) for direction in (X, Z, ALONG)] == pytest.approx([along_x, along_z, along])
    moved = np.array([0.0, 0.0, 5.0]), np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # its z is now along x
    assert reach(one, moved, X) == pytest.approx(along_z)
    assert reach(one, moved, Z) >= 5.0


def test_a_hull_reaches_to_its_farthest_corner() -> None:
    corners = np.array([[0.1, 0.0, 0.0], [-0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.4]])
    hull = Shape("it", 1, "convex", (), *UPRIGHT, "solid", "body", corners)
    assert [reach(hull, UPRIGHT, direction) for direction in (X, -X, Z)] == pytest.approx([0.1, 0.3, 0.4])


def test_the_way_out_is_the_overlap_along_a_direction() -> None:
    one, other = volume(mobee.sphere(0.2)), volume(mobee.box(0.4, 0.4, 0.4))
    at: Place = np.array([0.35, 0.0, 0.0]), np.eye(3)
    assert way_out(one, at, other, UPRIGHT, X) == pytest.approx(0.05)
    assert way_out(one, at, other, UPRIGHT, -X) == pytest.approx(0.75)
    assert way_out(one, (2.0 * at[0], np.eye(3)), other, UPRIGHT, X) < 0.0
