# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.prm_vs_mdp import (
    BLOCK_SIZE,
    CLAIMS,
    EXPERIMENT,
    QUERY_TIMEOUT,
    SHIFT,
    TURN,
    WRONG,
    Scene,
    answer,
    believed,
    make_scene,
    row_of,
    rows_of,
    space,
    world_of,
)
from experiments.kit.cells import Cell, load_cells, write_cell
from experiments.kit.experiment import judged
from experiments.kit.learning.arm import whole
from experiments.kit.learning.arm_planners import Straight
from mobee import Model, load_robot
from mobee.errors import InvalidValue

HARD = np.tile([True, False], BLOCK_SIZE)


def rival(name, share, seconds):
    success = np.arange(2 * BLOCK_SIZE) < share * 2 * BLOCK_SIZE
    numbers = {
        "success": success,
        "seconds": np.full(2 * BLOCK_SIZE, seconds),
        "actions": np.full(2 * BLOCK_SIZE, 3),
        "repairs": np.zeros(2 * BLOCK_SIZE),
    }
    return {f"{name}|{measure}": values for measure, values in numbers.items()} | {f"{name}|cost": np.array(7.0)}


@pytest.fixture
def folder(tmp_path):
    """Three seeds: planned once succeeds in a half, repaired in all but 2 %, the MDP always."""
    for seed in range(3):
        both = rival("OMPL, planned once", 0.5, 60.0) | rival("OMPL, remembers", 1.0, 20.0)
        for belief in WRONG:
            cell = Cell(f"roadmaps-{belief.replace(' ', '-')}-s{seed}", seed, {"belief": belief})
            write_cell(tmp_path, cell, {"hard": HARD, **both}, 1.0)
        write_cell(
            tmp_path, Cell(f"mdp-s{seed}", seed, {"learned": 4000}), {"hard": HARD, **rival("MDP, 4000 learned", 1.0, 18.0 + seed)}, 1.0
        )
    return tmp_path


def test_a_row_summarises_all_seeds_of_a_rival_under_a_belief(folder):
    rows = rows_of(load_cells(folder))
    once = row_of(rows, "OMPL, planned once", "both")
    assert [once.numbers[name].mean() for name in ("success", "hard", "seconds")] == [0.5, 0.5, 60.0] and once.cost == 7.0
    learned = row_of(rows, "MDP, 4000 learned", "")
    assert learned.numbers["seconds"].tolist() == [18.0, 19.0, 20.0] and len(learned.blocks) == 2
    with pytest.raises(InvalidValue, match="resume"):
        row_of(rows, "straight", "")


def test_a_rival_that_fails_confirms_and_one_that_works_refutes(folder):
    first, second = judged(CLAIMS, rows_of(load_cells(folder)))
    assert (first["verdict"], second["verdict"]) == ("confirmed", "refuted")
    assert "0.50" in first["ours"] and "7.0 h" in second["ours"]


@pytest.mark.parametrize(("once", "mdp", "verdict"), [(0.9, 1.0, "confirmed"), (0.96, 1.0, "refuted"), (0.9, 0.9, "refuted")])
def test_a_roadmap_must_be_below_95_percent_and_below_the_mdp(tmp_path, once, mdp, verdict):
    for seed in range(2):
        all_hard = np.ones(2 * BLOCK_SIZE, dtype=bool)
        both = rival("OMPL, planned once", once, 60.0) | rival("OMPL, remembers", once, 20.0)
        for belief in WRONG:
            cell = Cell(f"roadmaps-{belief.replace(' ', '-')}-s{seed}", seed, {"belief": belief})
            write_cell(tmp_path, cell, {"hard": all_hard, **both}, 1.0)
        learned = {"hard": all_hard, **rival("MDP, 4000 learned", mdp, 18.0)}
        write_cell(tmp_path, Cell(f"mdp-s{seed}", seed, {"learned": 4000}), learned, 1.0)
    claims = judged(CLAIMS, rows_of(load_cells(tmp_path)))
    assert [claim["verdict"] for claim in claims] == [verdict, verdict]


def test_the_figure_of_an_unfinished_run_is_drawn(folder):
    pytest.importorskip("matplotlib")
    assert EXPERIMENT.method.figure(folder).stat().st_size > 10_000


@pytest.fixture(scope="module")
def scene():
    return make_scene(3, 6)


def test_a_seed_gives_the_same_scene_again(scene):
    again = make_scene(3, 6)
    for name in ("balls", "shifts", "turns", "starts", "goals", "is_hard"):
        assert np.array_equal(getattr(scene, name), getattr(again, name))
    assert not np.array_equal(make_scene(4, 2).balls, scene.balls)


def test_half_of_the_queries_are_hard_and_none_begins_in_its_goal(scene):
    assert scene.is_hard.sum() == 3
    assert all(space().state_of(q) != goal for q, goal in zip(scene.starts, scene.goals, strict=True))


def test_balls_and_joints_have_errors_of_the_stated_size(scene):
    assert np.linalg.norm(scene.shifts, axis=1) == pytest.approx(np.full(4, SHIFT))
    assert np.abs(scene.turns) == pytest.approx(np.full(4, TURN))


def test_straight_motions_reach_the_easy_goals_and_failed_queries_last_as_long_as_the_limit(scene):
    got = answer(scene, Straight(space()), 3)
    assert got.success[~scene.is_hard].all() and (got.seconds[got.success] < QUERY_TIMEOUT).all()
    assert (got.seconds[~got.success] == QUERY_TIMEOUT).all() and got.actions.min() >= 1


def test_without_cables_the_hard_states_are_believed_to_be_sound():
    far = Scene(np.full((1, 3), 5.0), np.zeros((1, 3)), np.zeros(4), np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool))
    samples = space().samples
    hard = [24, 51, 78]
    assert not believed(far, "true").sound(samples[hard]).any()
    assert believed(far, "no cables").sound(samples).all()


def test_a_miscalibrated_belief_has_the_ball_elsewhere():
    sample = space().samples[40]
    robot = load_robot("icub_2014")
    palm = Model(robot).evaluate(whole(sample)).position("left_palm")
    nowhere = np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
    scene = Scene(palm[None], np.array([[0.0, 0.0, 1.0]]), np.zeros(4), *nowhere)
    assert not believed(scene, "true").sound(sample[None])[0]
    assert believed(scene, "miscalibrated").sound(sample[None])[0]
    assert len(Model(robot, world_of(palm[None])).evaluate(whole(sample)).table)


def test_a_motion_past_a_ball_is_not_sound_though_its_ends_are():
    lattice = space()
    nowhere = np.zeros((0, 4)), np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
    start, end = lattice.samples[36], lattice.samples[44]
    ball = Model(load_robot("icub_2014")).evaluate(whole((start + end) / 2)).position("left_palm")
    belief = believed(Scene(ball[None], np.zeros((1, 3)), np.zeros(4), *nowhere), "no cables")
    assert belief.sound(np.array([start, end])).all()
    assert not belief.sound_motion(start, end)
