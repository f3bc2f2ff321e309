from __future__ import annotations

import importlib
from dataclasses import replace

import numpy as np
import pytest

from experiments.clauses.search import Search, keep, load, search
from experiments.control.arm_command import PHASES, random_command
from experiments.control.arm_try import Trial, try_commands
from experiments.control.margins import clause_violations
from experiments.control.ride import Ride
from mobee import Gains, load_robot

module = importlib.import_module("experiments.clauses.search")  # the package has a function of that name


@pytest.fixture
def imagined(monkeypatch):
    """A robot that violates its second clause the more, the farther the elbow's last attractor is from -3."""

    def trial(gains, commands, torso, seed):
        violations = np.full((2, 7), -0.5)
        violations[:, 1] = [-0.01 * abs(command.attractors[PHASES - 1, 3] + 3.0) for command in commands]
        return Trial(Ride(np.zeros((1, 1)), np.zeros((1, 1)), 0.01), violations, np.zeros(2))

    monkeypatch.setattr(module, "try_commands", trial)


def run(state: Search, tries: int) -> Search:
    for _ in search(state, tries):
        pass
    return state


def test_the_search_gets_nearer_to_the_worst_command_than_chance(imagined) -> None:
    state = run(Search("default", False, 1), 1000)
    assert state.tries == 1000
    assert state.worst > max(state.random) and state.worst > np.rad2deg(-0.002)
    assert state.by_clause[1] == state.worst and state.worst_try["clause"] == 1


def test_an_interrupted_search_goes_on_as_if_it_had_not_been(imagined, tmp_path) -> None:
    whole = run(Search("default", False, 5), 600)
    path = tmp_path / "part.json"
    for state in search(Search("default", False, 5), 600):
        keep(path, state)
        if state.tries >= 300:
            break
    again = run(load(path), 600)
    assert (again.tries, again.worst, again.by_clause, again.inside) == (600, whole.worst, whole.by_clause, whole.inside)


def test_a_try_is_judged_by_where_the_arms_have_been() -> None:
    robot = load_robot("icub")
    rng = np.random.default_rng(2)
    trial = try_commands(Gains.default(), [random_command(rng, False), random_command(rng, False)], np.zeros(3), 0)
    assert trial.violations.ravel() == pytest.approx(clause_violations(robot, trial.ride.q).max(axis=0))
    assert np.ptp(trial.ride.q, axis=0)[robot.parts["left_arm"].slice][:5].max() > 0.1


def test_a_client_pushes_at_motors_and_at_the_palm() -> None:
    rng = np.random.default_rng(4)
    still = [replace(random_command(rng, forced=False), attractors=np.zeros((PHASES, 7)), start=np.zeros(7)) for _ in range(2)]
    pushed = [replace(command, pushes=np.tile([0.0, 0.0, 1.0], (PHASES, 1))) for command in still]
    rides = [try_commands(Gains.default(), commands, np.zeros(3), 0).ride for commands in (still, pushed)]
    assert np.abs(rides[0].q[-1] - rides[1].q[-1]).max() > 0.1
