"""How much of what can be had on the toy arm learners come to have, by predictor and strategy: a table on standard output.

    python -m experiments.reaching.toy_scores --seeds 3 --only gp

Each row: the rewards of an evaluation on the 27 targets as a fraction of what an agent gets that knows the truth, after so many
problem-tries; then the same on eight targets between them that were never tried, after 800; then the time that learning took.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from experiments.reaching.toy_arm import MARKER, ToyArm, cell_centres, grid, oracle
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

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
    """Rewards as fractions of the oracle's after so many tries, shape (checkpoints,), and on targets never tried, NaN if not that far."""
    arm, problems, unseen = ToyArm(seed), grid(), np.nan
    agent = ReachAgent(
        arm.space,
        arm,
        arm,
        marker=MARKER,
        predictor=predictor,
        strategy=strategy,
        failures=failures,
        seed=seed,
        hands=arm.hands,
        jacobians=arm.jacobians,
    )
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
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
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
