# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.claims.ch3_roadmaps import trm
from experiments.claims.ch3_roadmaps.trm import (
    CLAIMS,
    COLUMNS,
    NAMES,
    PREGRASP,
    are_complete,
    built,
    coverage,
    findings,
    maps,
    maps_of_all,
    meet_constraints,
    reachable,
    rebuilt,
    size,
    soon,
    traversable,
    valid,
)
from experiments.claims.ch3_roadmaps.trm_pictures import planned
from experiments.claims.ch3_roadmaps.trm_tasks import EXAMPLES
from experiments.kit.cells import Cell
from experiments.kit.experiment import judged
from experiments.kit.roadmap_task import build
from mobee import costs, tasks
from mobee.roadmap.building.lattice_builder import Patience, lattice_poses
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.terms import Term
from mobee.roadmap.roadmap import Roadmap
from tests.experiments.finished_cells import finished
from tests.mobee.planar import planar_arm

SPACING = np.array([0.15, 0.15])
TASK = tasks.place("tip", "xy", [(0.0, 1.0), (-0.6, 0.6)])
TERMS = [costs.collision()]


@pytest.fixture(scope="module")
def arm() -> mobee.Model:
    return mobee.Model(planar_arm())


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trm, "GENEROUS", Patience(tries=4))
    monkeypatch.setattr(trm, "RANDOM_POINTS", 50)
    monkeypatch.setattr(trm, "STARTS", 4)


@pytest.fixture(scope="module")
def whole(arm: mobee.Model) -> tuple[np.ndarray, np.ndarray]:
    return lattice_poses(Problem(arm, TERMS, None, None), TASK, SPACING, np.random.default_rng(0))


def test_a_whole_map_covers_all(brief: None, arm: mobee.Model, whole: tuple[np.ndarray, np.ndarray]) -> None:
    points = reachable(arm, TERMS, TASK, SPACING)
    np.testing.assert_array_equal(points, reachable(arm, TERMS, TASK, SPACING))
    found = coverage(points, whole[1], SPACING)
    assert found.share > 0.99 and found.largest_hole < 1.2
    assert np.linalg.norm(found.reachable, axis=1).max() <= 0.9 + 1e-9
    assert len(points) > 3 * len(whole[1]) and len(found.far) == len(points) + len(whole[1])


def test_a_hole_is_found(brief: None, arm: mobee.Model, whole: tuple[np.ndarray, np.ndarray]) -> None:
    y = whole[1]
    left = y[np.linalg.norm(y - [0.5, 0.0], axis=1) > 0.32]
    found = coverage(reachable(arm, TERMS, TASK, SPACING), left, SPACING)
    assert found.share < 0.99
    assert found.largest_hole == pytest.approx(np.linalg.norm((left - [0.5, 0.0]) / SPACING, axis=1).min(), abs=0.5)


def test_every_fault_of_a_pose_is_found(arm: mobee.Model, whole: tuple[np.ndarray, np.ndarray]) -> None:
    q, y = whole[0][:6].copy(), whole[1][:6].copy()
    assert valid(arm, TERMS, TASK, q, y).all()
    q[1, 0] += 1e-6  # not where y says
    q[2] = [0.0, 3.0, 3.0]  # folded into itself
    y[2] = TASK.of(arm.evaluate(q[2:3]))[0]
    q[3, 2] = 3.5  # beyond its limit
    y[3] = TASK.of(arm.evaluate(q[3:4]))[0]
    assert valid(arm, TERMS, TASK, q, y).tolist() == [True, False, False, False, True, True]
    assert not valid(arm, TERMS, TASK, q[4:5] + [0.0, 0.0, 1e-12], y[4:5], motors=["m0", "m1"]).any()


def at(task: Task, y: tuple[float, ...], spacing: float) -> list[Term]:
    """The task coordinates as terms."""
    return [
        Term(
            one.name,
            lambda pose, one=one, value=value: np.abs(one.function(pose) - value),
            1.0 / spacing,
            0.1 * spacing,
            lambda robot, one=one, value=value: one.aims(robot, value),
        )
        for one, value in zip(task.coordinates, y, strict=True)
    ]


@pytest.mark.parametrize("name", EXAMPLES)
def test_a_pose_of_every_example_is_found_where_its_film_begins(name: str) -> None:
    example = EXAMPLES[name]()
    y = example.via[0]
    terms = [*example.costs, *at(example.task, y, float(np.min(example.spacing)))]
    ik = mobee.solve_ik(example.model, terms, start=example.start, motors=example.motors, method="least_squares")
    assert ik.reached and not ik.contacts
    assert np.abs(example.task.of(example.model.evaluate(ik.q[None]))[0] - y).max() <= 0.1 * np.max(example.spacing)


@pytest.fixture(scope="module")
def pushing() -> Roadmap:
    return build(EXAMPLES["push-over"](), "least_squares")


def table(**changes: float) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Numbers of two seeds of sound maps."""
    row = dict.fromkeys(COLUMNS, 1.0) | {"vertices": 5000.0} | changes
    return {(task, method): {name: np.full(2, value) for name, value in row.items()} for task in EXAMPLES for method in NAMES}


def verdicts(runs: dict[tuple[str, str], dict[str, np.ndarray]]) -> dict[str, str]:
    return {claim["text"]: claim["verdict"] for claim in judged(CLAIMS, runs)}


def test_a_film_goes_through_the_points_of_its_task(pushing: Roadmap) -> None:
    example = EXAMPLES["push-over"]()
    motion = planned(example, pushing)
    y = example.task.of(example.model.evaluate(np.array([pose.q for pose in motion.poses])))
    assert [np.abs(y - point).max(axis=1).min() <= example.spacing for point in example.via] == [True, True]
    assert np.abs(np.diff([pose.q for pose in motion.poses], axis=0)).max() <= 0.05 + 1e-12
    assert (np.diff(motion.times) > 0.0).all()


def test_a_map_is_measured_and_can_be_rebuilt() -> None:
    example = EXAMPLES["inspect"]()
    values = built(example, "least_squares", 0)
    assert values["valid"] == 1.0 and 0.0 < values["connected"] <= 1.0 and values["vertices"] == len(values["q"])
    again = rebuilt(example, values)
    np.testing.assert_array_equal(again.y, example.task.of(example.model.evaluate(values["q"])))


def test_claims_hold_of_sound_maps_and_fail_with_one_that_is_not() -> None:
    assert set(verdicts(table()).values()) == {"confirmed", "met"}
    for name, value, claim in (
        ("coverage", 0.9, maps_of_all),
        ("valid", 0.999, meet_constraints),
        ("connected", 0.9, traversable),
        ("vertices", 900.0, size),
        ("processor_s", 130.0, soon),
    ):
        wrong = table()
        wrong[PREGRASP if claim is size else "inspect", "nes"][name][1] = value
        found = verdicts(wrong)
        assert [text for text, verdict in found.items() if verdict in ("not reproduced", "not met")] == [claim.text]


def test_claims_stay_open_until_every_task_was_mapped_by_both_methods() -> None:
    runs = table()
    del runs["inspect", "nes"]
    assert not are_complete(runs)


def test_the_reachable_points_are_those_of_the_search_and_of_all_other_maps() -> None:
    values = {"vertices": 2, "processor_s": 1.0, "valid": 1.0, "kept": 1.0, "free": 1.0, "connected": 1.0, "evaluations": 30}
    arrays = {"y": np.array([[0.0], [0.1]]), "spacing": np.array([0.1])}
    values_of = {
        "reach": {"points": np.array([[0.05], [0.43]])},
        "first": values | arrays,
        "second": values | arrays | {"y": np.array([[0.25], [0.35]])},
    }
    cells = [Cell(name, k, {"task": "inspect", "method": "reach" if name == "reach" else "nes"}) for k, name in enumerate(values_of)]
    found = finished(lambda cell: values_of[cell.name], cells)
    row = maps(found)["inspect", "nes"]
    np.testing.assert_allclose(row["coverage"], [3 / 6, 3 / 6])
    np.testing.assert_allclose(row["largest_hole"], [3.3, 2.5])
    assert row["evaluations_a_vertex"].tolist() == [15.0, 15.0]
    assert findings(maps(found))["maps"]["inspect"]["evolution"]["vertices"].startswith("2")
