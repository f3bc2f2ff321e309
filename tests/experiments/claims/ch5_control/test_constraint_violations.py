# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.claims.ch5_control import constraint_violations
from experiments.kit.control.arm_commands import PHASES, Tried, random_command, try_commands
from experiments.kit.control.measures import clause_violations
from experiments.kit.control.plant_runs import PlantRun
from mobee import Gains, load_robot


@pytest.fixture
def imagined(monkeypatch):
    """A robot that violates its second clause the more, the farther the elbow's last attractor is from -3."""

    def tried(gains, commands, torso, seed):
        violations = np.full((2, 7), -0.5)
        violations[:, 1] = [-0.01 * abs(command.attractors[PHASES - 1, 3] + 3.0) for command in commands]
        return Tried(PlantRun(np.zeros((1, 1)), np.zeros((1, 1)), 0.01), violations, np.zeros(2))

    monkeypatch.setattr(constraint_violations, "try_commands", tried)


def test_the_search_gets_nearer_to_the_worst_command_than_chance(imagined) -> None:
    state = constraint_violations.search("default", False, 1000, seed=1)
    assert state.tries == 1000
    assert state.worst > max(state.random) and state.worst > np.rad2deg(-0.002)
    assert state.by_clause[1] == state.worst and state.worst_try["clause"] == 1


@pytest.mark.parametrize("tries", [1, 2, 101, 333])
def test_the_search_makes_as_many_tries_as_are_asked_for(imagined, tries: int) -> None:
    state = constraint_violations.search("default", False, tries, seed=1)
    assert state.tries == state.course[-1][0] == tries


def test_the_uncounted_arm_of_an_odd_number_of_tries_is_not_judged(monkeypatch) -> None:
    def tried(gains, commands, torso, seed):
        return Tried(PlantRun(np.zeros((1, 1)), np.zeros((1, 1)), 0.01), np.array([[-0.5] * 7, [0.5] * 7]), np.array([0.1, 2.0]))

    monkeypatch.setattr(constraint_violations, "try_commands", tried)
    state = constraint_violations.search("default", False, 1, seed=1)
    assert state.worst < 0.0 and max(state.by_clause) < 0.0 and state.stop == pytest.approx(np.rad2deg(0.1))
    assert len(state.worst_try["commands"]) == 2 and state.worst_try["arm"] == 0


def test_a_try_is_judged_by_where_the_arms_have_been() -> None:
    robot = load_robot("icub")
    rng = np.random.default_rng(2)
    tried = try_commands(Gains.default(), [random_command(rng, False), random_command(rng, False)], np.zeros(3), 0)
    assert tried.violations.ravel() == pytest.approx(clause_violations(robot, tried.run.q).max(axis=0))
    assert np.ptp(tried.run.q, axis=0)[robot.parts["left_arm"].slice][:5].max() > 0.1


def test_a_client_pushes_at_motors_and_at_the_palm() -> None:
    rng = np.random.default_rng(4)
    still = [replace(random_command(rng, forced=False), attractors=np.zeros((PHASES, 7)), start=np.zeros(7)) for _ in range(2)]
    pushed = [replace(command, pushes=np.tile([0.0, 0.0, 1.0], (PHASES, 1))) for command in still]
    runs = [try_commands(Gains.default(), commands, np.zeros(3), 0).run for commands in (still, pushed)]
    assert np.abs(runs[0].q[-1] - runs[1].q[-1]).max() > 0.1
