# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import sys

import numpy as np
import pytest

import mobee
from experiments.bench.ik import (
    BOXES,
    MOTORS,
    RIVALS,
    TARGETS_PER_TURN,
    Entrant,
    Settings,
    Solve,
    measure,
    scene,
    solve_by_turns,
    targets,
)
from experiments.bench.ik_rivals import MinkPeer, Target
from experiments.bench.timing import Calibration
from mobee.errors import NotInstalled
from mobee.roadmap.ik.problem import Problem


@pytest.fixture(scope="module")
def model() -> mobee.Model:
    return scene()


def test_the_scene_has_its_boxes_and_home_is_free(model: mobee.Model) -> None:
    assert len(model.world.snapshot.objects) == BOXES
    assert model.evaluate(model.robot.home).count == 0


def test_targets_are_the_same_for_the_same_seed_and_have_solutions(model: mobee.Model) -> None:
    aims = targets(model, 3)
    np.testing.assert_array_equal([aim.position for aim in aims], [aim.position for aim in targets(model, 5)[:3]])
    assert all(mobee.solve_ik(model, aim.costs(), motors=MOTORS).reached for aim in aims)


@pytest.mark.parametrize("name", RIVALS)
def test_rivals_reach_an_easy_target_and_stop(model: mobee.Model, name: str) -> None:
    if name.startswith("CMA"):
        pytest.importorskip("cma")
    there = model.evaluate(model.robot.home).position("right_palm")
    problem = Problem(model, [mobee.costs.position("right_palm", there + [0.0, 0.0, 0.02], tolerance=0.02)], None, MOTORS)
    found = RIVALS[name](problem, 0, 5000)
    assert found is not None
    assert np.linalg.norm(model.evaluate(found).position("right_palm") - there - [0.0, 0.0, 0.02]) <= 0.02


def test_mink_finds_poses_that_are_good_by_our_own_model(model: mobee.Model) -> None:
    pytest.importorskip("mink")
    peer = MinkPeer(model.robot)
    for seed, aim in enumerate(targets(model, 5)):
        problem = Problem(model, aim.costs(), None, MOTORS)
        found = peer.solve(problem, aim, seed, 2000)
        assert found is not None
        pose = model.evaluate(found[None])
        assert np.linalg.norm(pose.position("right_palm")[0] - aim.position) <= 0.005
        assert pose.count[0] == 0 and (found >= model.robot.limits[:, 0]).all() and (found <= model.robot.limits[:, 1]).all()
        still = np.setdiff1d(np.arange(len(found)), problem.free)
        np.testing.assert_array_equal(found[still], model.robot.home[still])


def test_without_mink_it_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cma")
    monkeypatch.setitem(sys.modules, "mink", None)
    with pytest.raises(NotInstalled, match=r"\[bench\]"):
        measure(Settings())


def test_solvers_take_turns_and_every_target_has_its_own_seed() -> None:
    given: list[tuple[str, int]] = []

    def solver(name: str) -> Solve:
        def solve(aim: Target, seed: int) -> tuple[bool, int]:
            given.append((name, seed))
            return name == "a", 7

        return solve

    aims = [Target(np.zeros(3), np.eye(3))] * (TARGETS_PER_TURN + 2)
    found = solve_by_turns(
        {"a": Entrant(solver("a"), aims), "b": Entrant(solver("b"), aims[:3])}, Calibration(lambda: 0.5), lambda done, name: None
    )
    turns = [("a", 0), ("b", 0), *(("a", seed) for seed in range(TARGETS_PER_TURN)), *(("b", seed) for seed in range(3))]
    assert given == [*turns, ("a", TARGETS_PER_TURN), ("a", TARGETS_PER_TURN + 1)]
    assert found["a"].reached == [True] * len(aims) and found["b"].evaluations == [7] * 3
    assert found["a"].standard_ms == [0.5 * ms for ms in found["a"].ms]
