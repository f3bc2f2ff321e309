from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.bench import agreement, workload
from experiments.bench.agreement import Agreement, Detect, agreements
from mobee import Model
from mobee.collision.contact import ContactTable

POSES = 20
KINDS = [shape.kind for shape in workload.robot().shapes]


@pytest.fixture(scope="module")
def table() -> ContactTable:
    return Model(workload.robot()).evaluate(workload.poses(POSES)).table


def told(table: ContactTable, peer: str, more: float = 0.0, but: int | None = None) -> Agreement:
    """What is said of a peer that finds the same, but depths off by `more` and one contact left out."""
    rows = np.array([row for row in range(len(table)) if row != but])

    def detect(pose: int) -> tuple[np.ndarray, np.ndarray]:
        here = rows[table.pose[rows] == pose]
        return np.stack([table.first[here], table.second[here]], axis=1), table.depth[here] + more

    found: Detect = detect
    return agreement._compare(peer, 0, table, found, KINDS, POSES)


def test_the_same_contacts_pass(table: ContactTable) -> None:
    found = told(table, "coal")
    assert (found.passed, found.other_pairs, found.contacts) == (True, 0, len(table))
    assert set(found.depth_difference.values()) == {0.0}


def test_a_contact_that_one_alone_finds_does_not_pass(table: ContactTable) -> None:
    deepest = int(table.depth.argmax())
    found = told(table, "MuJoCo", but=deepest)
    assert (found.passed, found.other_pairs, found.deepest_other) == (False, 1, table.depth[deepest])


def test_a_graze_that_one_alone_finds_passes(table: ContactTable) -> None:
    reals = table.reals.copy()
    reals[3, 0] = agreement.GRAZE / 2.0
    assert told(replace(table, reals=reals), "coal", but=3).passed


def test_other_depths_do_not_pass_but_for_mujoco_whose_depths_are_of_another_kind(table: ContactTable) -> None:
    assert not told(table, "coal", more=1e-5).passed
    assert told(table, "coal", more=1e-7).passed
    assert told(table, "MuJoCo", more=1e-5).passed
    assert told(table, "MuJoCo", more=1e-5).depth_difference["capsule-sphere"] == pytest.approx(1e-5)


def test_the_model_and_all_peers_agree_among_boxes() -> None:
    for module in ("mujoco", "pinocchio"):
        pytest.importorskip(module)
    found = agreements(30, POSES, with_coal=True)
    assert [one.peer for one in found] == ["MuJoCo", "python-fcl", "coal"]
    assert [one.peer for one in found if not one.passed] == []
    assert all(one.contacts > 50 for one in found)
