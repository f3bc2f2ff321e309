# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.changed_worlds import (
    BALLS,
    CHANGES,
    CHECKPOINTS,
    CLAIMS,
    LEARNERS,
    OURS,
    RADIUS,
    TURN,
    WITHOUT,
    FixedRate,
    LikelihoodRatio,
    failures,
    plant_of,
    relative,
    runs_of,
    seen_plant,
    targets,
)
from experiments.kit.cells import Cell
from experiments.kit.experiment import judged
from experiments.kit.learning.arm import RIGHT, robot
from experiments.kit.reaching.arm import MARKER, JudgedPlant, SeenHand, reach_space
from tests.experiments.finished_cells import finished


def test_the_balls_are_away_from_targets_and_robot():
    places = np.array([target.position for target in targets()])
    assert len(set(BALLS)) == 20
    assert min(np.linalg.norm(places - ball, axis=1).min() for ball in BALLS) >= 0.12
    plant = plant_of("ball", 0, 0)
    assert plant.model.world.objects["ball"].position == pytest.approx(BALLS[0])
    assert not len(plant.model.evaluate(plant.robot.home).contacts) and RADIUS == 0.1


def test_the_other_changes_raise_the_table_and_turn_the_joints():
    top = [plant_of(change, -1, 0).model.world.objects["table"].position[2] for change in ("nothing", "table")]
    assert top[1] - top[0] == pytest.approx(0.08)
    plant = plant_of("turn", -1, 0)
    assert isinstance(plant, JudgedPlant) and np.count_nonzero(np.abs(plant.errors.turns) == TURN) == 4


def test_an_object_is_seen_with_errors_of_a_centimetre():
    balls = [seen_plant("ball", 3, seed).model.world.objects["ball"] for seed in range(40)]
    errors = np.array([ball.position - BALLS[3] for ball in balls])
    assert np.abs(errors.mean(axis=0)).max() < 0.006 and errors.std() == pytest.approx(0.01, rel=0.25)
    assert np.std([ball.size[0] for ball in balls]) == pytest.approx(0.005, rel=0.4)
    tables = [seen_plant("table", -1, seed).model.world.objects["table"].position[2] for seed in range(40)]
    raised = plant_of("table", -1, 0).model.world.objects["table"].position[2]
    assert np.mean(tables) == pytest.approx(raised, abs=0.006) and np.std(tables) == pytest.approx(0.01, rel=0.4)


def test_the_likelihood_ratio_reports_a_larger_share_once():
    detector, rng = LikelihoodRatio(), np.random.default_rng(2)
    found = [detector.add(0.001 if one else 0.95, 0.5) for one in [*(rng.random(400) < 0.03), *(rng.random(200) < 0.4)]]
    numbers = [number for number, since in enumerate(found) if since is not None]
    assert len(numbers) == 1 and 400 <= numbers[0] < 440 and abs(numbers[0] + 1 - found[numbers[0]] - 400) <= 10


def test_a_fixed_rate_reports_a_change_after_every_hundred_outcomes():
    detector = FixedRate()
    assert [number for number in range(1, 301) if detector.add(1.0, 1.0) is not None] == [100, 200, 300]


def runs(score, failed, false=0):
    """Five equal runs of each learner: the last score over the oracle's, failures, and false detections of the one that is judged."""
    ours, plain = np.full(len(CHECKPOINTS), score), np.ones(len(CHECKPOINTS))
    found = {}
    for change in CHANGES:
        for name in LEARNERS:
            found[change, name] = [
                [
                    {
                        "score": 6.0 * (plain if change == "nothing" and name == WITHOUT else ours),
                        "failures": np.full(len(CHECKPOINTS), failed),
                        "oracle": 6.0,
                        "false": false if name == OURS else 0,
                        "detected": np.inf,
                    }
                ]
            ] * 5
    return found


def test_claims_are_judged_by_scores_failures_and_the_unchanged_world():
    good, bad = (judged(CLAIMS, runs(*numbers)) for numbers in ((0.999, 1.0), (0.9, 3.0, 1)))
    assert [claim["verdict"] for claim in good] == ["met"] * len(CLAIMS)
    assert [claim["verdict"] for claim in bad] == ["not met"] * len(CLAIMS)
    assert "0 changes detected in 5 runs" in good[-1]["ours"] and "5 changes detected" in bad[-1]["ours"]


def test_a_hand_that_is_seen_corrects_joints_that_are_miscalibrated():
    """The learner's plant finds the offsets, and the result is judged by the true place of the hand."""
    hand, plant = SeenHand(robot(), RIGHT, 0), plant_of("turn", -1, 0)
    corrected = hand.correct(plant)
    space = reach_space()
    for state in (40, 41, 50, 31, 44, 13):
        corrected.act(space.part, space.target(state))
    turns = np.rad2deg(plant.errors.turns[[plant.robot.motor_index(name) for name in RIGHT]])
    assert np.rad2deg(hand.offsets.offsets) == pytest.approx(turns, abs=3.0) and len(hand.offsets.changes) == 1
    hand.is_seen, before = False, hand.offsets.observations
    corrected.present(targets()[13])
    found = corrected.reach(space.part, MARKER)
    assert hand.offsets.observations == before
    assert found.missing == pytest.approx(targets()[13].missing(plant.reached)) and (found.marker == plant.reached).all()


def test_a_result_with_balls_is_computed_from_the_means_over_their_seeds():
    def values(cell):
        score = {"0": [1.0, 3.0], "1": [4.0, 4.0], "-1": [1.0, 3.0]}[str(cell.settings["ball"])][cell.seed]
        found = {name: np.full((len(LEARNERS), 1), score) for name in ("score", "failures", "without")}
        return found | {name: np.zeros(len(LEARNERS)) for name in ("false", "detected")} | {"oracle": 2.0}

    settings = [{"change": "ball" if ball >= 0 else "table", "ball": ball} for ball in (0, 1, -1)]
    found = runs_of(finished(values, [Cell(f"ball{one['ball']}-s{seed}", seed, one) for one in settings for seed in (1, 0)]))
    assert relative(found["ball", OURS]).tolist() == [[1.0], [2.0]] and failures(found["ball", OURS]).tolist() == [[2.0], [4.0]]
    assert relative(found["table", OURS]).tolist() == [[0.5], [1.5]]
