# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from experiments.claims.ch8_reaching.live_reach.problems import space
from experiments.kit.reaching.arm import MARKER, reach_space
from experiments.kit.reaching.learning import Course, learn
from experiments.kit.reaching.targets import between, grid, targets_at
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.plant import Outcome
from tests.experiments.kit.reaching.test_truth import ExactPlant


class Obedient:
    """A plant whose arm is where it was sent."""

    def __init__(self) -> None:
        self.robot = space().robot
        self.q = space().target(40)

    def measure(self, part: str) -> np.ndarray:
        return self.q

    def act(self, part: str, target: np.ndarray) -> Outcome:
        self.q = target
        return Outcome(target, True, 1.0, ())


def ends(apart: float) -> list[int]:
    """The states from which it would reach, where those near state 0 are worth most."""
    plant, worth = Obedient(), np.full(81, 0.05)
    worth[[0, 1, 3, 9, 27]] = [0.9, 0.5, 0.4, 0.3, 0.2]
    agent = ReachAgent(space(), plant, marker="right_palm")  # type: ignore[arg-type]  # a course never reaches, so the plant need not
    course = Course(plant, agent, lambda target: worth.copy(), lambda: np.zeros(3), np.random.default_rng(0), apart)
    found = []
    for _ in range(2):
        course.go()
        found.append(space().state_of(plant.q[space().columns]))
        course.missed()
    return found


def test_after_a_miss_the_learner_goes_to_the_next_best_state() -> None:
    first, second = ends(0.0)
    assert first == 0 and second == 1


def test_states_one_step_from_one_that_missed_are_left_out_too_if_that_is_asked_for() -> None:
    first, second = ends(0.25)
    assert first == 0 and second not in (0, 1, 3, 9, 27)


def test_tries_are_counted_by_the_numbers_of_the_given_problems():
    space, problems = reach_space(), targets_at(grid())
    agent = ReachAgent(space, ExactPlant(space), marker=MARKER, strategy="random", seed=2)
    sets = {"grid": problems, "between": targets_at(between())}
    values = learn(agent, problems, [10, 54], 1, sets)
    assert np.bincount(values["problem"]).tolist() == [2] * 27
    assert values["rewards_grid"].shape == (2, 1, 27) and values["states_between"].shape == (2, 1, 8)
    reached = values["reach_state"] >= 0
    assert np.allclose(values["reward"][reached], 1.0 / (1.0 + values["reach_state"][reached]))
    assert (values["actions"][reached] >= 1).all() and (values["actions"] <= agent.limit).all()
    assert values["failures"].sum() == 0 and values["duration"].min() >= 2.0
