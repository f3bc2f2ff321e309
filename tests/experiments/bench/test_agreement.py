# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.bench.agreement import (
    DEPTH_TOLERANCE,
    MIN_OVERLAP,
    UNKNOWN_DEPTH,
    Agreement,
    ModelContacts,
    Place,
    agreements,
    compared,
    extent,
    separation,
)
from experiments.bench.scenes import MAKERS, Maker, Scene, upper_body_scene
from mobee.model.world_object import WorldObject

POSES = 20


@pytest.fixture(scope="module")
def scene() -> Scene:
    return upper_body_scene(0, POSES)


@pytest.fixture(scope="module")
def ours(scene: Scene) -> ModelContacts:
    return ModelContacts(scene)


def compared_with(
    scene: Scene, ours: ModelContacts, peer: str, more: float = 0.0, without: float | None = None, turned: bool = False
) -> Agreement:
    """Compare with a peer that finds the same contacts, but depths greater by `more`, and not the contact of the depth `without`.

    `turned`: its normals have the opposite direction.
    """

    def detect(pose: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        here = {pair: found for pair, found in ours.contacts[pose].items() if found[0] != without}
        normals = [-normal if turned else normal for _, normal in here.values()]
        depths = np.array([depth + more for depth, _ in here.values()])
        return np.array(list(here), dtype=np.intp).reshape(-1, 2), depths, np.array(normals).reshape(-1, 3)

    return compared(peer, scene, ours, detect)


def depths(ours: ModelContacts) -> list[float]:
    return sorted(depth for contacts in ours.contacts for depth, _ in contacts.values())


def test_the_same_contacts_pass(scene: Scene, ours: ModelContacts) -> None:
    found = compared_with(scene, ours, "coal")
    assert (found.passed, found.other_pairs, found.contacts) == (True, 0, len(ours))
    assert set(found.depth_difference.values()) == {0.0} and found.same_depths == 1.0
    assert ours.depth_error() < DEPTH_TOLERANCE


def test_a_contact_found_by_only_one_does_not_pass(scene: Scene, ours: ModelContacts) -> None:
    deepest = depths(ours)[-1]
    found = compared_with(scene, ours, "MuJoCo", without=deepest)
    assert (found.passed, found.other_pairs, found.deepest_other) == (False, 1, deepest)


def test_a_shallow_contact_found_by_only_one_passes(scene: Scene) -> None:
    found = ModelContacts(scene)
    pose, contacts = next((at, one) for at, one in enumerate(found.contacts) if one)
    pair = next(iter(contacts))
    found.contacts[pose][pair] = MIN_OVERLAP / 2.0, contacts[pair][1]
    assert compared_with(scene, found, "coal", without=MIN_OVERLAP / 2.0).passed


def test_other_depths_do_not_pass_except_mujocos_which_are_per_contact_point(scene: Scene, ours: ModelContacts) -> None:
    assert not compared_with(scene, ours, "coal", more=1e-5).passed
    assert compared_with(scene, ours, "coal", more=1e-7).passed
    assert compared_with(scene, ours, "MuJoCo", more=1e-5).passed
    found = compared_with(scene, ours, "MuJoCo", more=1e-5)
    assert found.depth_difference["capsule-sphere"] == pytest.approx(1e-5) and found.same_depths == 0.0


def test_a_depth_that_is_not_minimal_does_not_pass(scene: Scene) -> None:
    found = ModelContacts(scene)
    pose, contacts = next((at, one) for at, one in enumerate(found.contacts) if one)
    pair, (depth, normal) = next(iter(contacts.items()))
    found.contacts[pose][pair] = depth + 1e-6, normal  # as if our separation were longer
    found_beaten = compared_with(scene, found, "MuJoCo")
    assert not found_beaten.passed and found_beaten.beaten == pytest.approx(1e-6, rel=1e-3)
    assert found.depth_error() == pytest.approx(1e-6, rel=1e-3)


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.name)
def test_the_model_and_all_peers_agree_on_robots_of_other_makers(maker: Maker) -> None:
    for module in ("mujoco", "pinocchio"):
        pytest.importorskip(module)
    found, depth_error = agreements(maker.scene(30, POSES), with_coal=True)
    assert [one.peer for one in found if not one.passed] == []
    assert all(one.contacts > 50 for one in found)
    assert depth_error < DEPTH_TOLERANCE


def test_a_depth_that_a_peer_does_not_compute_is_not_compared(scene: Scene, ours: ModelContacts) -> None:
    found = compared_with(scene, ours, "coal", more=2.0 * UNKNOWN_DEPTH)
    assert found.passed and found.depth_difference == {}


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
def test_extents_of_the_primitives(geometry: mobee.Geometry, along_x: float, along_z: float, along: float) -> None:
    one = volume(geometry)
    assert [extent(one, UPRIGHT, direction) for direction in (X, Z, ALONG)] == pytest.approx([along_x, along_z, along])
    moved = np.array([0.0, 0.0, 5.0]), np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # its z is now along x
    assert extent(one, moved, X) == pytest.approx(along_z)
    assert extent(one, moved, Z) >= 5.0


def test_the_separation_is_the_overlap_along_a_direction() -> None:
    one, other = volume(mobee.sphere(0.2)), volume(mobee.box(0.4, 0.4, 0.4))
    at: Place = np.array([0.35, 0.0, 0.0]), np.eye(3)
    assert separation(one, at, other, UPRIGHT, X) == pytest.approx(0.05)
    assert separation(one, at, other, UPRIGHT, -X) == pytest.approx(0.75)
    assert separation(one, (2.0 * at[0], np.eye(3)), other, UPRIGHT, X) < 0.0
