# SPDX-License-Identifier: Apache-2.0
"""A toy arm of four joints whose true rewards are known, to compare quickly how agents learn to reach for targets.

    python -m experiments.kit.reaching.toy_arm --seeds 3 --only gp

The arm has two links on a shoulder of three joints, with the ranges of the iCub.  A reach moves the hand to the target by damped least
squares, by at most half a radian per joint; its start pose is noisy.  Its reward is high if a small distance remains (thesis eq. 8.4).  An
action in which the arm comes near the centre of a target (within 10 cm) is blocked, and mostly fails.

The command prints a table with a row for each learner, named by its predictor of rewards, its exploration strategy and its memory of failed
actions.  All numbers are means over the seeds.  The headings of the columns 50 to 1600 are numbers of attempts to reach one target.  These
columns have the learner's rewards on the 27 targets after so many attempts, divided by those of an oracle, an agent that knows the true
rewards.  The column "new" has the same fraction for eight other targets, the centres of the cells of the grid of 27.  The learner never
tries them; it is evaluated on them after 800 attempts.  The column "s" has the run time per seed [s].
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.learning.arm import RIGHT, arm_space
from experiments.kit.reaching.learning import Learner
from mobee import Lattice
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.explorers import Draws
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.tabular import ReachTable, ideal
from mobee.reach import ReachOutcome, ReachTarget, reward_of

UPPER, FORE = 0.152, 0.20  # m: shoulder to elbow, elbow to palm
MAX_REACH = 0.5  # rad per joint, motion of a reach
STEPS, DAMPING, PULL = 30, 0.02, 0.6  # of the least squares; DAMPING in m
WAYPOINTS = 9  # poses of an action's path that are checked
LEAVE_MARGIN = 0.005  # m: an arm already near the target may leave it


def hands(poses: Array) -> Array:
    """Return the positions of the palm, (..., 3) m from the shoulder, in poses (..., 4) rad: shoulder pitch, roll, yaw, elbow.

    x points forward, y outward, z up.
    """
    upper, fore = _links(poses)
    return upper + fore


def missing(starts: Array, target: Array, ranges: Array) -> Array:
    """Return the remaining errors (...) m of reaches for a target at a position (3,) m, relative to the shoulder.

    `starts`: (..., 4) rad, poses in which the reaches start.  `ranges`: (4, 2) rad, of the joints.
    """
    low, high = np.maximum(starts - MAX_REACH, ranges[:, 0]), np.minimum(starts + MAX_REACH, ranges[:, 1])
    q = np.clip(starts, low, high)
    for _ in range(STEPS):
        hand, jacobian = hands(q), jacobians(q)
        square = jacobian @ np.swapaxes(jacobian, -1, -2) + DAMPING**2 * np.eye(3)
        pulled = np.linalg.solve(square, (target - hand)[..., None])
        q = np.clip(q + PULL * (np.swapaxes(jacobian, -1, -2) @ pulled)[..., 0], low, high)
    distance: Array = np.linalg.norm(target - hands(q), axis=-1)
    return distance


def jacobians(poses: Array) -> Array:
    """Return the derivatives of the palm's position by the joints in poses (..., 4) rad, (..., 3, 4) m/rad, by central differences."""
    step = 1e-6
    return np.stack([(hands(poses + step * unit) - hands(poses - step * unit)) / (2.0 * step) for unit in np.eye(4)], axis=-1)


def swept(starts: Array, ends: Array, point: Array, clearance: float) -> NDArray[np.bool_]:
    """Return which straight motions bring the arm within `clearance` [m] of a point (3,) m, and nearer to it than at the start, (S, A).

    `starts`: (S, 4) rad.  `ends`: (S, A, 4) rad, the A ends of the motions from each start.  The point is relative to the shoulder.
    """
    shares = np.linspace(0.0, 1.0, WAYPOINTS)[:, None]
    upper, fore = _links(starts[:, None, None] + shares * (ends - starts[:, None])[:, :, None])
    near = np.minimum(_distance(np.zeros(3), upper, point), _distance(upper, fore, point))
    passed: NDArray[np.bool_] = near.min(axis=-1) < np.minimum(clearance, near[..., 0] - LEAVE_MARGIN)
    return passed


def _links(poses: Array) -> tuple[Array, Array]:
    """Return two vectors, (..., 3) m each: from the shoulder to the elbow, and from the elbow to the palm.

    `poses`: (..., 4) rad, shoulder pitch, roll, yaw, elbow.  x points forward, y outward, z up.
    """
    pitch, roll, yaw, elbow = np.moveaxis(np.asarray(poses), -1, 0)
    none, bent = np.zeros_like(pitch), np.sin(elbow)
    upper = np.stack([none, none, np.full_like(pitch, -UPPER)], axis=-1)
    fore = FORE * np.stack([bent * np.cos(yaw), bent * np.sin(yaw), -np.cos(elbow)], axis=-1)
    return _turned(upper, pitch, roll), _turned(fore, pitch, roll)


def _turned(vector: Array, pitch: Array, roll: Array) -> Array:
    x, y, z = np.moveaxis(vector, -1, 0)
    y, z = np.cos(roll) * y - np.sin(roll) * z, np.sin(roll) * y + np.cos(roll) * z
    return np.stack([np.cos(pitch) * x + np.sin(pitch) * z, y, np.cos(pitch) * z - np.sin(pitch) * x], axis=-1)


def _distance(start: Array, along: Array, point: Array) -> Array:
    """Return the distances (...) m from a point (3,) m to line segments.

    Each segment goes from `start` (..., 3) to `start` + `along` (..., 3), m.
    """
    share = np.clip(((point - start) * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    gap: Array = np.linalg.norm(start + share[..., None] * along - point, axis=-1)
    return gap


MARKER = "toy_palm"
NOISE = 0.04  # rad, standard deviation
STARTS = 8  # noisy start poses of each state's reaches
CLEARANCE = 0.10  # m: actions whose path comes nearer to a target are blocked, 11 per cent
FAILURE_PROBABILITY = 0.9  # of a blocked action
QUANTILES = (0.15, 0.5, 0.85)  # of the hand positions in each direction, where the targets are
SURE_FAILURES = 20  # failures after which an action is not tried again


class ToyArm(ReachTable):
    """The toy arm as a plant with 81 states, a `mobee.learning.tabular.ReachTable` (plant whose outcomes are given by tables).

    `seed`: seed of the random outcomes.  `start`: the first state.
    """

    def __init__(self, seed: int = 0, start: int = 0) -> None:
        space = toy_space()
        super().__init__(space, *ideal(space), self._of, seed=seed, start=start)
        self.hands: Array = hands(space.samples)
        """(S, 3) m from the shoulder, position of the palm in each state."""
        self.jacobians: Array = jacobians(space.samples)
        """(S, 3, 4) m/rad, derivatives of `hands` by the joints."""
        self._starts = Draws("toy arm")
        self._place: Array = np.empty(3)

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world, or move it there; None removes it, as in `mobee.reach.ReachPlant.present`."""
        super().present(target)
        if target is not None:
            self._place = target.position

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Return the outcome of a reach for the presented target, from one of 8 noisy start poses in the present state.

        `part`, `marker` and `stay` are arguments of `mobee.reach.ReachPlant.reach`.  Raises InvalidValue if no target is presented.
        """
        if self._presented is None:
            raise InvalidValue("nothing to reach for: present a target first.")
        start = int(self._starts.at(self.seed, self.actions).integers(STARTS))
        self._presented = _missing(self._place.tobytes())[:, start], self._presented[1]
        return super().reach(part, marker, stay)

    @staticmethod
    def _of(target: Array) -> tuple[Array, Array]:
        return _missing(target.tobytes()).mean(axis=1), FAILURE_PROBABILITY * blocked(target).astype(np.float64)


class Truth:
    """A predictor that returns the true mean rewards of the toy arm."""

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Do nothing: the rewards are known already."""

    def mean(self, target: Array) -> Array:
        """Return the true mean reward of reaching for a target (3,) m from each state, (S,)."""
        return true_rewards(target)

    def deviation(self, target: Array) -> Array:
        """Return zeros (S,): nothing is uncertain."""
        return np.zeros(len(toy_space()))

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the true mean reward of reaching for a target (3,) m from each state, (S,)."""
        return true_rewards(target)

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor, as a dict of JSON values."""
        return {"name": "truth"}


def toy_agent(arm: ToyArm, seed: int, predictor: Any, strategy: str, failures: str) -> ReachAgent:
    """Return a `ReachAgent` that moves the toy arm `arm`.

    `seed`: seed of the agent.  `predictor`, `strategy`, `failures`: passed to `ReachAgent` as its arguments with the same names.
    """
    kind = Learner(predictor, strategy, failures)
    return kind.agent(arm.space, arm, arm, marker=MARKER, seed=seed, hands=arm.hands, jacobians=arm.jacobians)


def oracle(targets: list[ReachTarget], seed: int = 0) -> ReachAgent:
    """Return an agent that knows all mean rewards and the actions that `targets` block, on a toy arm of its own.

    It is meant to be evaluated, not to learn.  `seed`: seed of arm and agent.
    """
    agent = toy_agent(ToyArm(seed), seed, Truth(), "greedy", "local")
    for target in targets:
        for state, action in np.argwhere(blocked(target.position)).tolist():
            for _ in range(SURE_FAILURES):
                agent.failures.add(state, action, target.position, agent.penalty)
    return agent


@cache
def toy_space() -> Lattice:
    """Return the 81 states of the four joints of the right arm; every call returns the same object."""
    return arm_space(joints=RIGHT)


def true_rewards(target: Array) -> Array:
    """Return the true mean reward of reaching for a target (3,) m, relative to the shoulder, from each state, (S,)."""
    rewards: Array = np.vectorize(reward_of)(_missing(target.tobytes()))
    mean: Array = rewards.mean(axis=1)
    return mean


def blocked(target: Array) -> NDArray[np.bool_]:
    """Return which actions are blocked by a target, (S, A): on their path the arm comes within 10 cm (CLEARANCE) of its centre.

    `target`: (3,) m, its position relative to the shoulder.  An action that leads away from the target is not blocked (`swept`).
    """
    space = toy_space()
    found: NDArray[np.bool_] = swept(space.samples, space.samples[space.goals], target, CLEARANCE) & (space.goals >= 0)
    return found


@cache
def grid() -> list[ReachTarget]:
    """Return 27 targets on a 3 x 3 x 3 grid, positions in m relative to the shoulder; z changes fastest, x slowest.

    The three values of each coordinate are the 0.15, 0.5 and 0.85 quantiles of the palm's coordinate in 4000 random poses.
    """
    low, high = _ranges().T
    reached = hands(np.random.default_rng(0).uniform(low, high, size=(4000, 4)))
    axes = np.quantile(reached, QUANTILES, axis=0).T
    return [ReachTarget(np.array([x, y, z])) for x in axes[0] for y in axes[1] for z in axes[2]]


def cell_centres() -> list[ReachTarget]:
    """Return eight targets that no learner tries: the centres of the cells between the 27 targets of `grid`."""
    cube = np.array([target.position for target in grid()]).reshape(3, 3, 3, 3)
    corners = [(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    return [ReachTarget(cube[i : i + 2, j : j + 2, k : k + 2].mean(axis=(0, 1, 2))) for i, j, k in corners]


@cache
def _ranges() -> Array:
    robot = toy_space().robot
    return robot.limits[[robot.motor_index(name) for name in RIGHT]]


@cache
def _missing(place: bytes) -> Array:
    """Return the remaining errors (S, STARTS) m of reaches for a target, from STARTS (8) noisy start poses in each state.

    A remaining error is the distance of the palm from the target after the reach.  `place`: position of the target relative to the
    shoulder, (3,) m, as the bytes of the array (a key for the cache).  The start poses are the same for all targets.
    """
    space = toy_space()
    noise = NOISE * np.random.default_rng(0).standard_normal((len(space), STARTS, 4))
    return missing(space.samples[:, None] + noise, np.frombuffer(place), _ranges())


CHECKPOINTS = (50, 100, 200, 400, 800, 1600)
UNSEEN_AFTER = 800
REPETITIONS, REPETITIONS_UNSEEN = 3, 10
ROWS = (
    ("weighted", "random", "spread"),
    ("weighted", "greedy", "spread"),
    ("weighted", "intrinsic", "spread"),
    ("weighted", "intrinsic", "local"),
    ("gp", "ucb", "spread"),
    ("gp", "ucb", "local"),
    ("weighted", "intrinsic", "alike"),
    ("weighted", "greedy", "alike"),
    ("table", "ucb", "alike"),
    ("kernel", "random", "alike"),
    ("kernel", "progress", "alike"),
    ("kernel", "ucb", "alike"),
    ("kernel_prior", "ucb", "alike"),
    ("nearest", "ucb", "alike"),
    ("networks", "thompson", "alike"),
    ("gp", "random", "alike"),
    ("gp", "greedy", "alike"),
    ("gp", "intrinsic", "alike"),
    ("gp", "progress", "alike"),
    ("gp", "thompson", "alike"),
    ("gp", "ucb", "alike"),
)


def scores(predictor: str, strategy: str, failures: str, seed: int, checkpoints: Sequence[int] = CHECKPOINTS) -> tuple[Array, float]:
    """Return the rewards of a learner as fractions of the oracle's: on the 27 targets at each checkpoint (L,), and on eight other targets.

    `predictor`, `strategy`, `failures`: arguments of `ReachAgent`.  `seed`: seed of arm and learner.  The oracle is an agent that knows the
    true rewards.  `checkpoints`: (L,), after how many problem-tries (attempts to reach one target) the learner is evaluated, ascending.
    The learner never tries the eight other targets; it is evaluated on them after 800 problem-tries; the second result is NaN if 800 is no
    checkpoint.
    """
    problems, unseen = grid(), np.nan
    agent = toy_agent(ToyArm(seed), seed, predictor, strategy, failures)
    found = []
    for tries in checkpoints:
        agent.learn(problems, tries - agent.tries)
        found.append(_fraction(agent, problems, REPETITIONS))
        if tries == UNSEEN_AFTER:
            unseen = _fraction(agent, cell_centres(), REPETITIONS_UNSEEN)
    return np.array(found), unseen


def _fraction(agent: ReachAgent, problems: list[ReachTarget], repetitions: int) -> float:
    best = oracle(problems, agent.seed).evaluate(problems, repetitions).rewards.sum()
    return float(agent.evaluate(problems, repetitions).rewards.sum() / best)


def main() -> None:
    """Print the table of the scores of all learners, with the options of the command line."""
    parser = argparse.ArgumentParser(description="Scores of learners on the toy arm, by predictor and strategy.")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--most", type=int, default=CHECKPOINTS[-1], help="problem-tries")
    parser.add_argument("--only", nargs="*", default=[], help="words that rows must all have, such as: gp ucb")
    arguments = parser.parse_args()
    checkpoints = [n for n in CHECKPOINTS if n <= arguments.most]
    print(f"{'predictor strategy failures':32}", *[f"{n:5}" for n in checkpoints], " new      s")
    for row in ROWS:
        if set(arguments.only) <= set(row):
            start = time.perf_counter()
            runs = [scores(*row, seed, checkpoints) for seed in range(arguments.seeds)]
            taken = (time.perf_counter() - start) / arguments.seeds
            known, unseen = np.mean([run[0] for run in runs], axis=0), np.mean([run[1] for run in runs])
            print(f"{' '.join(row):32}", *[f"{one:5.2f}" for one in known], f"{unseen:5.2f} {taken:6.1f}", flush=True)


if __name__ == "__main__":
    main()
