from __future__ import annotations

import numpy as np
import pytest

from experiments.bench import agreement, random_robots, workload
from experiments.bench.agreement import GRAZE, MINIMAL, Agreement, Found, Scene, agreements, compared
from experiments.bench.random_robots import MAKERS, Maker

POSES = 20


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene("iCub", workload.robot(), workload.world(0), workload.poses(POSES))


@pytest.fixture(scope="module")
def ours(scene: Scene) -> Found:
    return Found(scene)


def told(scene: Scene, ours: Found, peer: str, more: float = 0.0, but: float | None = None, turned: bool = False) -> Agreement:
    """What is said of a peer that finds the same, but depths off by `more`, and not the contact of the depth `but`.

    `turned`: its normals lead elsewhere.
    """

    def detect(pose: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        here = {pair: found for pair, found in ours.contacts[pose].items() if found[0] != but}
        normals = [-normal if turned else normal for _, normal in here.values()]
        depths = np.array([depth + more for depth, _ in here.values()])
        return np.array(list(here), dtype=np.intp).reshape(-1, 2), depths, np.array(normals).reshape(-1, 3)

    return compared(peer, scene, ours, detect)


def depths(ours: Found) -> list[float]:
    return sorted(depth for contacts in ours.contacts for depth, _ in contacts.values())


def test_the_same_contacts_pass(scene: Scene, ours: Found) -> None:
    found = told(scene, ours, "coal")
    assert (found.passed, found.other_pairs, found.contacts) == (True, 0, len(ours))
    assert set(found.depth_difference.values()) == {0.0} and found.same_depths == 1.0
    assert ours.off() < MINIMAL


def test_a_contact_that_one_alone_finds_does_not_pass(scene: Scene, ours: Found) -> None:
    deepest = depths(ours)[-1]
    found = told(scene, ours, "MuJoCo", but=deepest)
    assert (found.passed, found.other_pairs, found.deepest_other) == (False, 1, deepest)


def test_a_graze_that_one_alone_finds_passes(scene: Scene) -> None:
    found = Found(scene)
    pose, contacts = next((at, one) for at, one in enumerate(found.contacts) if one)
    pair = next(iter(contacts))
    found.contacts[pose][pair] = GRAZE / 2.0, contacts[pair][1]
    assert told(scene, found, "coal", but=GRAZE / 2.0).passed


def test_other_depths_do_not_pass_but_for_mujoco_whose_depths_are_of_another_kind(scene: Scene, ours: Found) -> None:
    assert not told(scene, ours, "coal", more=1e-5).passed
    assert told(scene, ours, "coal", more=1e-7).passed
    assert told(scene, ours, "MuJoCo", more=1e-5).passed
    found = told(scene, ours, "MuJoCo", more=1e-5)
    assert found.depth_difference["capsule-sphere"] == pytest.approx(1e-5) and found.same_depths == 0.0


def test_a_shorter_way_out_than_ours_is_found_out(scene: Scene) -> None:
    found = Found(scene)
    pose, contacts = next((at, one) for at, one in enumerate(found.contacts) if one)
    pair, (depth, normal) = next(iter(contacts.items()))
    found.contacts[pose][pair] = depth + 1e-6, normal  # as if ours led a longer way
    found_beaten = told(scene, found, "MuJoCo")
    assert not found_beaten.passed and found_beaten.beaten == pytest.approx(1e-6, rel=1e-3)
    assert found.off() == pytest.approx(1e-6, rel=1e-3)


def test_a_peer_with_longer_ways_out_does_not_beat_ours(scene: Scene, ours: Found) -> None:
    found = told(scene, ours, "MuJoCo", turned=True)
    assert found.passed and found.beaten <= MINIMAL


def test_the_model_and_all_peers_agree_among_boxes() -> None:
    for module in ("mujoco", "pinocchio"):
        pytest.importorskip(module)
    found, off = agreements(Scene("iCub", workload.robot(), workload.world(30), workload.poses(POSES)), with_coal=True)
    assert [one.peer for one in found] == ["MuJoCo", "python-fcl", "coal"]
    assert [one.peer for one in found if not one.passed] == []
    assert all(one.contacts > 50 for one in found)
    assert off < MINIMAL


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.name)
def test_and_on_robots_of_other_makers(maker: Maker) -> None:
    for module in ("mujoco", "pinocchio"):
        pytest.importorskip(module)
    world = random_robots.world(maker, 30)
    found, off = agreements(Scene(maker.name, random_robots.robot(maker), world, random_robots.poses(maker, POSES)), with_coal=True)
    assert [one.peer for one in found if not one.passed] == []
    assert all(one.contacts > 50 for one in found)
    assert off < MINIMAL


def test_a_depth_that_a_peer_does_not_know_is_not_compared(scene: Scene, ours: Found) -> None:
    found = told(scene, ours, "coal", more=2.0 * agreement.UNKNOWN)
    assert found.passed and found.depth_difference == {}
