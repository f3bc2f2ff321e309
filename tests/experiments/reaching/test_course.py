"""Within a try it is remembered from where a reach missed."""

from __future__ import annotations

import numpy as np

from experiments.live_reach.settings import space
from experiments.reaching.course import Course
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.plant import Outcome


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


def test_who_missed_goes_to_the_next_best_state() -> None:
    first, second = ends(0.0)
    assert first == 0 and second == 1


def test_states_one_step_from_one_that_missed_are_left_out_too_if_that_is_asked_for() -> None:
    first, second = ends(0.25)
    assert first == 0 and second not in (0, 1, 3, 9, 27)
