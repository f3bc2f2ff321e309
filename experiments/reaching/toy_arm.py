"""An arm of four joints that reaches at once: a small world whose truth is known, to compare learners of reaches on.

Two links on a shoulder of three joints, with the ranges of the iCub's.  A reach draws the hand to the target by damped least
squares and may leave its pose by half a radian a joint; where the arm really is when it begins is not quite known.  Targets are
balls, and most actions that sweep through one fail.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from experiments.kit.arm_learning import RIGHT, arm_space
from experiments.reaching.toy_kinematics import hands, jacobians, missing, swept
from mobee import Lattice
from mobee.errors import InvalidValue
from mobee.learning.draws import Draws
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.table import ReachTable
from mobee.learning.tabular import ideal
from mobee.reach import ReachOutcome, ReachTarget, reward_of
from mobee.robot.robot import Array

MARKER = "toy_palm"
NOISE = 0.04  # rad, standard deviation
STARTS = 8  # poses, around a state's, from which its reaches begin
CLEARANCE = 0.10  # m: an action whose way comes nearer to a target is blocked; 11 per cent are
FAILS = 0.9  # probability that it fails then
QUANTILES = (0.15, 0.5, 0.85)  # of the places that the hand can come to, a direction: where the targets stand
SURE = 20  # failures after which nobody tries again


class ToyArm(ReachTable):
    """The right arm's lattice of 81 states with such reaches."""

    def __init__(self, seed: int = 0, start: int = 0) -> None:
        space = toy_space()
        super().__init__(space, *ideal(space), self._of, seed=seed, start=start)
        self.hands: Array = hands(space.samples)
        """(S, 3) m, from the shoulder."""
        self.jacobians: Array = jacobians(space.samples)
        """(S, 3, 4) m/rad, how the joints move the hand."""
        self._starts = Draws("toy arm")
        self._place: Array = np.empty(3)

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world; None takes it away."""
        super().present(target)
        if target is not None:
            self._place = target.position

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """End where a reach from one of the starting poses does."""
        if self._presented is None:
            raise InvalidValue("nothing to reach for: present a target first.")
        start = int(self._starts.at(self.seed, self.actions).integers(STARTS))
        self._presented = _missing(self._place.tobytes())[:, start], self._presented[1]
        return super().reach(part, marker, stay)

    @staticmethod
    def _of(target: Array) -> tuple[Array, Array]:
        return _missing(target.tobytes()).mean(axis=1), FAILS * blocked(target)


class Truth:
    """The predictor that knows the mean rewards of the toy arm."""

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn nothing."""

    def mean(self, target: Array) -> Array:
        """The mean rewards, shape (S,)."""
        return true_rewards(target)

    def deviation(self, target: Array) -> Array:
        """None at all, shape (S,)."""
        return np.zeros(len(toy_space()))

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """The mean rewards, shape (S,)."""
        return true_rewards(target)

    @property
    def settings(self) -> dict[str, Any]:
        """Its name."""
        return {"name": "truth"}


def oracle(targets: list[ReachTarget], seed: int = 0) -> ReachAgent:
    """An agent on a toy arm of its own that knows all mean rewards and all blocked actions, and learns nothing."""
    arm = ToyArm(seed)
    agent = ReachAgent(
        arm.space,
        arm,
        arm,
        marker=MARKER,
        predictor=Truth(),
        strategy="greedy",
        failures="local",
        seed=seed,
        hands=arm.hands,
        jacobians=arm.jacobians,
    )
    for target in targets:
        for state, action in np.argwhere(blocked(target.position)).tolist():
            for _ in range(SURE):
                agent.failures.add(state, action, target.position, agent.penalty)
    return agent


@cache
def toy_space() -> Lattice:
    """81 states of the four joints of the right arm."""
    return arm_space(joints=RIGHT)


def true_rewards(target: Array) -> Array:
    """Mean rewards of reaching from each state, shape (S,)."""
    return np.asarray(reward_of(_missing(target.tobytes()))).mean(axis=1)


def blocked(target: Array) -> Array:
    """Which actions a target is in the way of, shape (S, A)."""
    space = toy_space()
    return swept(space.samples, space.samples[space.goals], target, CLEARANCE) & (space.goals >= 0)


@cache
def grid() -> list[ReachTarget]:
    """27 targets, three places a direction, between which most of what the hand can come to lies."""
    low, high = _ranges().T
    reached = hands(np.random.default_rng(0).uniform(low, high, size=(4000, 4)))
    axes = np.quantile(reached, QUANTILES, axis=0).T
    return [ReachTarget(np.array([x, y, z])) for x in axes[0] for y in axes[1] for z in axes[2]]


def cell_centres() -> list[ReachTarget]:
    """Eight targets that nobody is taught on: in the middle of each cell of the grid."""
    cube = np.array([target.position for target in grid()]).reshape(3, 3, 3, 3)
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    return [ReachTarget(cube[i : i + 2, j : j + 2, k : k + 2].mean(axis=(0, 1, 2))) for i, j, k in corners]


@cache
def _ranges() -> Array:
    robot = toy_space().robot
    return robot.limits[[robot.motor_index(name) for name in RIGHT]]


@cache
def _missing(place: bytes) -> Array:
    """How far reaches from each state end from a target, shape (S, STARTS), in m; the starts are the same for all targets."""
    space = toy_space()
    noise = NOISE * np.random.default_rng(0).standard_normal((len(space), STARTS, 4))
    return missing(space.samples[:, None] + noise, np.frombuffer(place), _ranges())
