# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee._core.rays import Chosen, cast
from mobee.errors import UnknownName
from mobee.rendering.camera import NEAREST, Camera, Raster, camera_axes, eye_camera, framing, pixel_middles
from mobee.rendering.mesh import Piece, mesh_of
from mobee.rendering.solid import Solid, ball, packed

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
AHEAD = camera_axes((0.0, 0.0))  # looks along x


def camera(size: float = 1.0, pixels: int = 50, axes: np.ndarray = AHEAD) -> Camera:
    return Camera(axes, np.array([-0.5 * size, 0.5 * size]), pixels / size, pixels, pixels)


def turn(seed: int) -> np.ndarray:
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def test_a_sphere_covers_the_pixels_whose_centres_are_within_its_radius() -> None:
    seen = Raster(camera(), [ball(np.array([0.3, 0.11, -0.07]), 0.203, RED)])
    right, up = pixel_middles(seen.camera)
    beside = np.hypot(right + 0.11, up[:, None] + 0.07)  # y is to the left of a camera in front of the robot
    np.testing.assert_array_equal(np.isfinite(seen.depth), beside <= 0.203)
    inside = beside < 0.19
    np.testing.assert_allclose(seen.depth[inside], 0.3 - np.sqrt(0.203**2 - beside[inside] ** 2), atol=1e-5)


def test_a_box_covers_the_pixels_whose_centres_are_within_its_edges() -> None:
    seen = Raster(camera(), [Solid("box", (0.5, 0.31, 0.63), np.zeros(3), np.eye(3), RED)])
    right, up = pixel_middles(seen.camera)
    np.testing.assert_array_equal(np.isfinite(seen.depth), (np.abs(right) <= 0.155) & (np.abs(up[:, None]) <= 0.315))
    np.testing.assert_allclose(seen.depth[np.isfinite(seen.depth)], -0.25, atol=1e-6)
    np.testing.assert_allclose(seen.normal[25, 25], [-1.0, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("nearer_first", [True, False])
def test_the_nearer_hides_the_farther_in_whatever_order_they_are_drawn(nearer_first: bool) -> None:
    near, far = ball(np.array([-0.5, 0.0, 0.0]), 0.1, RED, group=1), ball(np.array([0.5, 0.0, 0.0]), 0.3, BLUE, group=2)
    seen = Raster(camera(), [near, far] if nearer_first else [far, near])
    alone = np.isfinite(Raster(camera(), [near]).depth)
    assert (seen.group[alone] == 1).all() and (seen.color[alone] == RED).all()
    assert (seen.group[~alone & np.isfinite(seen.depth)] == 2).all() and (seen.group == 2).any()


SHAPES = [
    Solid("box", (0.2, 0.3, 0.15), np.zeros(3), np.eye(3), RED),
    Solid("cylinder", (0.1, 0.3), np.zeros(3), np.eye(3), RED),
    Solid("capsule", (0.08, 0.2), np.zeros(3), np.eye(3), RED),
    Solid("sphere", (0.15,), np.zeros(3), np.eye(3), RED),
]


def inside(solid: Solid, points: np.ndarray) -> np.ndarray:
    x, y, z = ((points - solid.position) @ solid.rotation).T
    if solid.kind == "sphere":
        return x**2 + y**2 + z**2 <= solid.size[0] ** 2
    if solid.kind == "box":
        return (2.0 * np.abs(np.stack([x, y, z])) <= np.array(solid.size)[:, None]).all(axis=0)
    radius, half = solid.size[0], 0.5 * solid.size[1]
    if solid.kind == "cylinder":
        return (x**2 + y**2 <= radius**2) & (np.abs(z) <= half)
    return x**2 + y**2 + (z - np.clip(z, -half, half)) ** 2 <= radius**2


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_rays_enter_a_turned_volume_where_points_along_them_begin_to_be_inside(shape: Solid, seed: int) -> None:
    rng = np.random.default_rng(seed)
    solid = Solid(shape.kind, shape.size, rng.uniform(-0.1, 0.1, 3), turn(seed), RED)
    eye = camera(0.8, 8, turn(seed + 1))
    seen = Raster(eye, [solid])
    right, up = pixel_middles(eye)
    starts = right[:, None] * eye.axes[0] + up[:, None, None] * eye.axes[1]
    ahead = np.arange(-0.4, 0.4, 0.002)
    within = inside(solid, (starts[:, :, None] + ahead[:, None] * eye.axes[2]).reshape(-1, 3)).reshape(8, 8, -1)
    first = np.where(within.any(axis=2), ahead[within.argmax(axis=2)], np.inf)
    both = np.isfinite(first)
    assert np.isfinite(seen.depth[both]).all()
    late = first[both] - seen.depth[both]
    assert (late >= -1e-4).all() and (late <= 0.0021).all()
    assert (np.isfinite(seen.depth) & ~both).sum() <= 3  # only where less than a step of the ray is inside
    outwards = seen.normal[np.isfinite(seen.depth)]
    np.testing.assert_allclose(np.linalg.norm(outwards, axis=1), 1.0, atol=1e-3)
    assert (outwards @ eye.axes[2] <= 1e-3).all()


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_an_eye_sees_a_turned_volume_where_points_along_its_rays_begin_to_be_inside(shape: Solid, seed: int) -> None:
    rng = np.random.default_rng(seed)
    solid = Solid(shape.kind, shape.size, rng.uniform(-0.3, 0.3, 3), turn(seed), RED)
    eye = eye_camera(rng.uniform(-0.3, 0.3, 3), turn(seed + 1), 8, 8, 90.0)  # at times inside the volume, or with it behind
    seen = Raster(eye, [solid])
    right, up = pixel_middles(eye)
    rays = right[:, None] * eye.axes[0] + up[:, None, None] * eye.axes[1] + eye.axes[2]
    depths = np.arange(NEAREST, 1.2, 0.001)
    assert eye.eye is not None
    within = inside(solid, (eye.eye + depths[:, None] * rays[:, :, None]).reshape(-1, 3)).reshape(8, 8, -1)
    entered = within[..., 1:] & ~within[..., :-1]
    first = np.where(entered.any(axis=2), depths[1:][entered.argmax(axis=2)], np.inf)
    first[within[..., 0]] = np.inf  # the ray begins inside: the surface is behind the eye or too near
    both = np.isfinite(first)
    assert np.isfinite(seen.depth[both]).all()
    late = first[both] - seen.depth[both]
    assert (late >= -1e-4).all() and (late <= 0.0011).all()
    assert (np.isfinite(seen.depth) & ~both).sum() <= 3  # only where less than a step of the ray is inside


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_chosen_rays_meet_what_the_rays_of_the_whole_picture_meet(seed: int) -> None:
    """Also boxes that surround the eye or are behind it, and triangles smaller than a pixel and larger than the picture."""
    rng = np.random.default_rng(seed)
    solids = [replace(shape, position=rng.uniform(-0.3, 0.3, 3), rotation=turn(seed)) for shape in SHAPES]
    corners = np.concatenate([rng.uniform(-2.0, 2.0, (9, 3)), rng.uniform(-0.01, 0.01, (90, 3))])
    mesh = mesh_of(Piece(corners, np.arange(99).reshape(33, 3)))
    packs = packed([*solids, Solid("mesh", (), np.zeros(3), np.eye(3), BLUE, mesh=mesh)])
    for eye in (eye_camera(rng.uniform(-0.3, 0.3, 3), turn(seed + 1), 37, 23, 90.0), replace(camera(1.0, 23, turn(seed + 1)), width=37)):
        every = cast(packs.volumes, packs.surfaces, eye.rays())
        mask = rng.uniform(size=(23, 37)) < 0.6
        some = cast(packs.volumes, packs.surfaces, eye.rays(), Chosen.of(mask))
        for whole, part in zip(every, some, strict=True):
            np.testing.assert_array_equal(part, whole[mask])


def test_the_hull_of_a_boxs_corners_is_seen_as_the_box() -> None:
    corners = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T * (0.1, 0.15, 0.075)
    eye, rotation = camera(axes=turn(3)), turn(4)
    box = Raster(eye, [Solid("box", (0.2, 0.3, 0.15), np.zeros(3), rotation, RED)])
    hull = Raster(eye, [Solid("convex", (), np.zeros(3), rotation, RED, vertices=corners)])
    np.testing.assert_allclose(hull.depth, box.depth, atol=1e-5)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.kind)
def test_a_framed_volume_fills_the_picture_up_to_its_margin(shape: Solid) -> None:
    solid = Solid(shape.kind, shape.size, np.array([0.3, -0.2, 0.5]), turn(9), RED)
    eye = framing(turn(10), [solid], np.empty((0, 3)), 400, margin=0.02)
    seen = np.isfinite(Raster(eye, [solid]).depth)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    for gap in (rows[0], eye.height - 1 - rows[-1], columns[0], eye.width - 1 - columns[-1]):
        assert abs(gap - 0.02 * eye.scale) <= 2.0


def test_the_robots_right_is_left_in_front_of_it_and_its_front_right_at_its_right_side() -> None:
    np.testing.assert_allclose(camera_axes("front")[0] @ [0.0, 1.0, 0.0], -1.0)
    np.testing.assert_allclose(camera_axes("side")[0] @ [-1.0, 0.0, 0.0], 1.0)
    for view in ("front", "side", "oblique", "left", "top", "behind"):
        np.testing.assert_allclose(camera_axes(view) @ camera_axes(view).T, np.eye(3), atol=1e-12)
        assert camera_axes(view)[1][2] > 0.0


def test_an_unknown_view_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="oblique"):
        camera_axes("obliqe")
