# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.cells import Cell, write_cell
from experiments.kit.learning import live as live_learning
from experiments.kit.learning.live import (
    JOINTS,
    RATE,
    ROBOTS,
    TASKS,
    Contacts,
    agents,
    compared,
    contacts,
    counts_of,
    distance,
    keep_observed,
    learn_live,
    offline_plant,
    variations,
)
from mobee import Lattice, load_robot
from mobee.store import STORE, Transition, TransitionStore
from services.launcher.scenario import read_scenario


def made(folder, part, count, end=1):
    with TransitionStore(folder / STORE, part) as store:
        for n in range(len(store.load()) + 1, count + 1):
            store.append(Transition(n, 0, 0, end, 0.0, True, 4.0, (0.0,)))


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("robot", ROBOTS)
def test_the_launcher_takes_the_scenario_and_its_agents_are_those_of_the_offline_plant(tmp_path, monkeypatch, task, robot):
    started = []

    def launched(path, ticks, runs):
        started.append((read_scenario(path), ticks))
        for part in TASKS[task].parts:
            made(tmp_path, part, 30)
        return {}

    monkeypatch.setattr(live_learning, "summary_of", launched)
    learn_live(task, robot, 3, 30, tmp_path, lambda number: None)
    ((scenario, ticks),) = started
    configs = {part.who: part.config for part in scenario.parts}
    assert scenario.is_locked and ticks > 30 * 4 * RATE
    assert configs["robot_sim"].backend == robot and configs["robot_sim"].rate == RATE
    assert configs["robot_sim"].motors == ("identified" if robot == "kinematic" else "published")
    offline = agents(TASKS[task], offline_plant(TASKS[task], 3), 3)
    assert [f"agent_{agent.part}" for agent in offline] == [who for who in configs if who.startswith("agent_")]
    for agent in offline:
        config = configs[f"agent_{agent.part}"]
        assert (config.joints, config.neighbours, config.seed) == (agent.space.joints, agent.space.neighbours, agent.seed)
        assert (config.explorer, config.discount, config.initial, config.transitions) == ("curious", 0.9, "50-50", 30)


def test_it_continues_with_another_seed_until_all_parts_have_enough(tmp_path, monkeypatch):
    seeds, reported = [], []

    def launched(path, ticks, runs):
        scenario = read_scenario(path)
        seeds.append(next(part.config.seed for part in scenario.parts if part.who == "robot_sim"))
        made(tmp_path, "left_arm", 10 * len(seeds))
        made(tmp_path, "right_arm", 10 * len(seeds) - 3)
        return {}

    monkeypatch.setattr(live_learning, "summary_of", launched)
    learn_live("arms", "kinematic", 0, 25, tmp_path, reported.append)
    assert reported == [0, 7, 17] and len(set(seeds)) == 3


def test_live_robots_are_held_against_all_offline_seeds_and_a_seed_against_the_others(tmp_path):
    for seed in range(3):
        rows = np.array([(0, 0, 1)] * 4 + [(1, 0, seed)] * 4)
        write_cell(
            tmp_path, Cell(f"arms-s{seed}", seed, {"task": "arms", "transitions": 8}), {"seen_left_arm": rows, "seen_right_arm": rows}, 1.0
        )
    (tmp_path / "arms" / "pybullet").mkdir(parents=True)
    for part in TASKS["arms"].parts:
        made(tmp_path / "arms" / "pybullet", part, 9, end=2)
    found = compared(tmp_path, "arms", 4)
    keep_observed(tmp_path / "arms" / "pybullet", "arms")  # what a record keeps in place of the store
    (tmp_path / "arms" / "pybullet" / STORE).unlink()
    assert compared(tmp_path, "arms", 4).live == found.live
    assert [one.variation for one in found.offline] == [0.5, 0.5, 0.5]
    assert (found.live["pybullet"].variation, found.live["pybullet"].agree, found.live["pybullet"].compared) == (1.0, 0.0, 2)
    assert found.counts["pybullet"]["left_arm"].sum() == 8  # as many as the offline seeds made


def test_actions_that_miss_their_goals_and_touch_are_counted_on_each_robot(tmp_path):
    goal = int(Lattice(load_robot("icub"), JOINTS["torso"], neighbours=4).goal(0, 0))
    rows, touched = np.array([(0, 0, goal), (0, 0, goal), (0, 0, 26), (0, 0, 26), (0, 0, 26)]), np.array([True, False, True, True, False])
    for seed, kept in enumerate((touched, touched, None)):  # the last is of an earlier version
        values = {f"seen_{part}": rows for part in TASKS["table"].parts}
        values |= {f"touched_{part}": kept for part in TASKS["table"].parts if kept is not None}
        write_cell(tmp_path, Cell(f"table-s{seed}", seed, {"task": "table", "transitions": 5}), values, 1.0)
    (tmp_path / "table" / "mujoco").mkdir(parents=True)
    with TransitionStore(tmp_path / "table" / "mujoco" / STORE, "torso") as store:
        store.append(Transition(1, 0, 0, 26, 0.0, True, 4.0, (0.0,), ("table",)))
    for part in ("left_arm", "right_arm"):
        made(tmp_path / "table" / "mujoco", part, 1)
    found = contacts(tmp_path, "table")
    assert found["offline"]["torso"] == Contacts(missed=6, touching=6, both=4, actions=10)
    assert found["mujoco"]["torso"] == Contacts(missed=1, touching=1, both=1, actions=1) and "pybullet" not in found


def test_a_part_with_enough_transitions_continues_so_that_no_other_waits(tmp_path, monkeypatch):
    left = []

    def launched(path, ticks, runs):
        goals = {part.who.removeprefix("agent_"): part.config.transitions for part in read_scenario(path).parts if "agent_" in part.who}
        left.append(goals)
        for part, goal in goals.items():
            made(tmp_path, part, goal - (4 if part == "right_arm" and len(left) == 1 else 0))
        return {}

    monkeypatch.setattr(live_learning, "summary_of", launched)
    learn_live("arms", "kinematic", 0, 25, tmp_path, lambda number: None)
    assert left == [{"left_arm": 25, "right_arm": 25}, {"left_arm": 29, "right_arm": 25}]


@pytest.fixture(scope="module")
def space():
    return Lattice(load_robot("icub"), JOINTS["left_arm"], neighbours=8)


def test_counts_say_how_often_each_outcome_was_seen(space):
    counts = counts_of(np.array([(0, 1, 5), (0, 1, 5), (0, 1, 6), (3, 2, 3)]), space)
    assert counts.shape == (81, 8, 81) and counts.sum() == 4
    assert (counts[0, 1, 5], counts[0, 1, 6], counts[3, 2, 3]) == (2, 1, 1)
    assert counts_of(np.zeros((0, 3)), space).sum() == 0


def test_total_variation_is_half_the_distance_of_the_shares(space):
    first = counts_of(np.array([(0, 0, 5)] * 3 + [(0, 0, 6)] + [(1, 0, 7)] * 4), space)
    second = counts_of(np.array([(0, 0, 5)] * 2 + [(0, 0, 9)] * 2 + [(1, 0, 7)] * 9), space)
    apart = variations(first, second, 4)
    assert apart[0, 0] == pytest.approx(0.5) and apart[1, 0] == 0.0
    assert np.isfinite(apart).sum() == 2 and np.isfinite(variations(first, second, 5)).sum() == 0
    assert np.array_equal(apart, variations(second, first, 4), equal_nan=True)


def test_the_distance_is_taken_over_the_actions_of_all_parts(space):
    first = {"a": counts_of(np.array([(0, 0, 5)] * 3), space), "b": counts_of(np.array([(0, 0, 5)] * 3), space)}
    second = {"a": counts_of(np.array([(0, 0, 5)] * 3), space), "b": counts_of(np.array([(0, 0, 6)] * 3), space)}
    found = distance(first, second, 3)
    assert (found.variation, found.agree, found.compared) == (0.5, 0.5, 2)
    assert distance(first, second, 4).compared == 0
