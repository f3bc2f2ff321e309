from __future__ import annotations

import itertools

import fcl
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.collision.narrow import fcl_touching, overlaps
from mobee.collision.volumes import place, volumes
from mobee.kinematics.quaternion import to_matrix
from tests.mobee.collision.convex import KINDS, overlap, overlap_along, random_solid, sampled_depth, solid

PAIRS = list(itertools.product(KINDS, KINDS))
SEEDS = st.integers(0, 100_000)
ALONG_X = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # takes local z to x


@pytest.mark.parametrize(("first", "second"), PAIRS)
@given(seed=SEEDS)
def test_moving_the_first_by_its_depth_just_separates(first, second, seed):
    rng = np.random.default_rng(seed)
    a, b = random_solid(rng, first), random_solid(rng, second)
    found = overlap(a, b)
    if found.depth[0] > 0.0:
        assert np.linalg.norm(found.normal[0]) == pytest.approx(1.0, abs=1e-12)
        # The plane across the normal is reached after exactly this way; fcl's sphere-cylinder is as exact.
        assert overlap_along(a, b, found.normal)[0] == pytest.approx(found.depth[0], abs=1e-9)


@pytest.mark.parametrize(("first", "second"), PAIRS)
@given(seed=SEEDS)
def test_no_direction_separates_sooner(first, second, seed):
    rng = np.random.default_rng(seed)
    a, b = random_solid(rng, first), random_solid(rng, second)
    depth, bound = overlap(a, b).depth[0], sampled_depth(a, b, rng)
    assert depth <= max(bound, 0.0) + 1e-6  # the refinement of cylinders ends at 1e-6 m
    if bound < 0.0:
        assert depth <= 0.0


@pytest.mark.parametrize(("first", "second"), PAIRS)
@given(seed=SEEDS)
def test_what_touches_is_what_fcl_says(first, second, seed):
    rng = np.random.default_rng(seed)
    a, b = random_solid(rng, first, spread=0.2), random_solid(rng, second, spread=0.2)
    depth = overlap(a, b).depth[0]
    placed = place(volumes([a, b], [0, 0]), np.eye(4)[None])
    if abs(sampled_depth(a, b, rng)) > 1e-4:  # closer than that fcl's iteration may say either
        assert (depth > 0.0) == fcl_touching(placed, 0, 1)


@pytest.mark.parametrize(("first", "second"), PAIRS)
@given(seed=SEEDS)
def test_changing_places_turns_the_normal(first, second, seed):
    rng = np.random.default_rng(seed)
    a, b = random_solid(rng, first), random_solid(rng, second)
    one, other = overlap(a, b), overlap(b, a)
    assert max(one.depth[0], 0.0) == pytest.approx(max(other.depth[0], 0.0), abs=1e-6)
    if one.depth[0] > 0.0:
        assert overlap_along(b, a, -one.normal)[0] == pytest.approx(other.depth[0], abs=1e-6)


@given(seed=SEEDS)
def test_spheres_follow_the_textbook(seed):
    rng = np.random.default_rng(seed)
    a, b = random_solid(rng, "sphere", 0.03), random_solid(rng, "sphere", 0.03)
    found = overlap(a, b)
    line = a.position - b.position
    distance = np.linalg.norm(line)
    assert found.depth[0] == pytest.approx(a.size[0] + b.size[0] - distance, abs=1e-15)
    assert found.normal[0] == pytest.approx(line / distance, abs=1e-12)
    midway = (a.position - a.size[0] * line / distance + b.position + b.size[0] * line / distance) / 2
    assert found.point[0] == pytest.approx(midway, abs=1e-12)


@pytest.mark.parametrize(
    ("z", "depth", "way"),
    [(0.2, 0.05, 1.0), (-0.2, 0.05, -1.0), (0.14, 0.11, 1.0), (0.1, 0.15, 1.0), (-0.01, 0.24, -1.0)],
)
def test_a_sphere_leaves_a_box_by_the_nearest_face_even_from_inside(z, depth, way):
    found = overlap(solid("sphere", (0.1,), (0.1, 0.2, z)), solid("box", (1.0, 1.0, 0.3)))
    assert found.depth[0] == pytest.approx(depth, abs=1e-15)
    assert found.normal[0] == pytest.approx([0.0, 0.0, way], abs=1e-15)
    assert found.point[0] == pytest.approx([0.1, 0.2, way * (0.15 - depth / 2)], abs=1e-15)


def test_a_sphere_leaves_a_capsule_sideways():
    found = overlap(solid("capsule", (0.05, 0.4)), solid("sphere", (0.1,), (0.12, 0.0, 0.1)))
    assert found.depth[0] == pytest.approx(0.03, abs=1e-15)
    assert found.normal[0] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-15)
    assert found.point[0] == pytest.approx([0.035, 0.0, 0.1], abs=1e-15)


def test_a_sphere_beyond_a_capsules_end_is_pushed_along_its_axis():
    found = overlap(solid("capsule", (0.05, 0.4)), solid("sphere", (0.1,), (0.0, 0.0, 0.32)))
    assert found.depth[0] == pytest.approx(0.03, abs=1e-15)
    assert found.normal[0] == pytest.approx([0.0, 0.0, -1.0], abs=1e-15)


def test_a_cylinder_standing_in_a_table_is_deep_by_its_foot():
    found = overlap(solid("cylinder", (0.05, 0.4), (0.1, 0.2, 0.33)), solid("box", (1.0, 1.0, 0.3)))
    assert found.depth[0] == pytest.approx(0.02, abs=1e-12)
    assert found.normal[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert found.point[0] == pytest.approx([0.1, 0.2, 0.14], abs=1e-9)


def test_concentric_volumes_have_some_way_out():
    for kind, size in (("sphere", (0.1,)), ("capsule", (0.1, 0.2)), ("cylinder", (0.1, 0.5)), ("box", (0.2, 0.3, 0.4))):
        found = overlap(solid(kind, size), solid(kind, size))
        assert found.depth[0] == pytest.approx(0.2, abs=1e-6)
        assert np.isfinite(found.point).all()


@given(seed=SEEDS)
def test_rounding_does_not_choose_the_point_of_a_capsule_lying_on_a_table(seed):
    rng = np.random.default_rng(seed)
    noise = 1e-13 * rng.normal(size=(3, 3))
    turn = to_matrix(np.array([np.cos(0.3), 0.0, 0.0, np.sin(0.3)])) @ ALONG_X + noise
    found = overlap(solid("capsule", (0.05, 0.2), (0.1, 0.0, 0.19), turn), solid("box", (1.0, 1.0, 0.3)))
    assert found.depth[0] == pytest.approx(0.01, abs=1e-9)
    assert found.point[0] == pytest.approx([0.1, 0.0, 0.145], abs=1e-9)


@given(seed=SEEDS)
def test_rounding_does_not_choose_the_point_of_parallel_capsules(seed):
    noise = 1e-13 * np.random.default_rng(seed).normal(size=(3, 3))
    found = overlap(solid("capsule", (0.05, 0.4)), solid("capsule", (0.05, 0.4), (0.08, 0.0, 0.1), np.eye(3) + noise))
    assert found.depth[0] == pytest.approx(0.02, abs=1e-9)
    assert found.point[0] == pytest.approx([0.04, 0.0, 0.05], abs=1e-7)  # the middle of the span they share


@given(seed=SEEDS)
def test_rounding_does_not_choose_the_point_of_a_capsule_run_through_a_box(seed):
    noise = 1e-13 * np.random.default_rng(seed).normal(size=(3, 3))
    found = overlap(solid("capsule", (0.02, 1.0), (0.03, 0.01, 0.1), np.eye(3) + noise), solid("box", (0.2, 0.2, 0.2)))
    assert found.normal[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert found.depth[0] == pytest.approx(0.09, abs=1e-9)
    assert found.point[0] == pytest.approx([0.055, 0.01, 0.0], abs=1e-7)


def test_many_pairs_at_once_equal_each_pair_alone(rng):
    items = [random_solid(rng, kind) for kind in KINDS for _ in range(4)]
    placed = place(volumes(items, [0] * len(items)), np.eye(4)[None])
    first, second = np.triu_indices(len(items), 1)
    found = overlaps(placed, first, second)
    for i, (a, b) in enumerate(zip(first, second, strict=True)):
        alone = overlap(items[a], items[b])
        assert max(found.depth[i], 0.0) == pytest.approx(max(alone.depth[0], 0.0), abs=1e-12)
        if alone.depth[0] > 0.0:
            assert found.normal[i] == pytest.approx(alone.normal[0], abs=1e-9)
            assert found.point[i] == pytest.approx(alone.point[0], abs=1e-9)


def test_fcl_points_its_normals_from_the_first_to_the_second():
    """The convention that `fcl_contact` turns round, pinned here in case a release of python-fcl changes it."""
    result = fcl.CollisionResult()
    here = fcl.CollisionObject(fcl.Sphere(0.1), fcl.Transform())
    there = fcl.CollisionObject(fcl.Cylinder(0.1, 0.4), fcl.Transform(np.array([0.15, 0.0, 0.0])))
    fcl.collide(here, there, fcl.CollisionRequest(enable_contact=True), result)
    assert result.contacts[0].normal == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
