from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.bench.ik import REQUIREMENTS, RIVALS, Settings, measure, report
from experiments.bench.ik_workload import BOXES, MOTORS, scene, targets
from mobee.roadmap.problem import Problem


@pytest.fixture(scope="module")
def model() -> mobee.Model:
    return scene()


def test_the_scene_has_its_boxes_and_home_is_free(model: mobee.Model) -> None:
    assert len(model.world.snapshot.objects) == BOXES
    assert model.evaluate(model.robot.home).count == 0


def test_targets_are_the_same_for_the_same_seed_and_have_solutions(model: mobee.Model) -> None:
    aims = targets(model, 3)
    np.testing.assert_array_equal([aim.place for aim in aims], [aim.place for aim in targets(model, 5)[:3]])
    assert all(mobee.solve_ik(model, aim.costs(), motors=MOTORS).reached for aim in aims)


@pytest.mark.parametrize("name", RIVALS)
def test_rivals_find_what_is_easy_and_know_when(model: mobee.Model, name: str) -> None:
    if name.startswith("CMA"):
        pytest.importorskip("cma")
    there = model.evaluate(model.robot.home).position("right_palm")
    problem = Problem(model, [mobee.costs.position("right_palm", there + [0.0, 0.0, 0.02], tolerance=0.02)], None, MOTORS)
    found = RIVALS[name](problem, 0, 5000)
    assert found is not None
    assert np.linalg.norm(model.evaluate(found).position("right_palm") - there - [0.0, 0.0, 0.02]) <= 0.02


@pytest.mark.parametrize("name", RIVALS)
def test_rivals_give_up(model: mobee.Model, name: str) -> None:
    if name.startswith("CMA"):
        pytest.importorskip("cma")
    problem = Problem(model, [mobee.costs.position("right_palm", [3.0, 0.0, 0.0])], None, MOTORS)
    assert RIVALS[name](problem, 0, 250) is None


def test_a_short_run_tells_all_rows_and_requirements() -> None:
    pytest.importorskip("cma")
    result = measure(Settings(targets=1, whole=1, rivals=1))
    assert len(result["rows"]) == 7 and len(result["requirements"]) == len(REQUIREMENTS)
    assert result["passed"] == all(one["passed"] for one in result["requirements"])
    lines = report(result).splitlines()
    assert max(map(len, lines)) <= 84
