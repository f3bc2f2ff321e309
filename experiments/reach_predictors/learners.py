"""Who is compared: predictors with what they explore by."""

from __future__ import annotations

from dataclasses import dataclass

ORACLE, TRUTH = "oracle", "truth"
LOOKS = (100, 200, 400, 800, 1600)  # problem-tries after which everybody is evaluated


@dataclass(frozen=True)
class Learner:
    """Names as of ReachAgent; `cost`: how long a run takes beside the others."""

    predictor: str
    strategy: str
    failures: str = "local"
    cost: float = 1.0


LEARNERS = {
    "published": Learner("weighted", "intrinsic", "spread"),
    "intrinsic": Learner("weighted", "intrinsic"),
    "greedy": Learner("weighted", "greedy"),
    "table": Learner("table", "greedy"),
    "kernel-random": Learner("kernel", "random", cost=2.0),
    "kernel-ucb": Learner("kernel", "ucb"),
    "kernel-prior-ucb": Learner("kernel_prior", "ucb"),
    "nearest-ucb": Learner("nearest", "ucb"),
    "networks-thompson": Learner("networks", "thompson", cost=2.0),
    "gp-greedy": Learner("gp", "greedy", cost=2.0),
    "gp-ucb": Learner("gp", "ucb", cost=2.0),
    "gp-ucb-alike": Learner("gp", "ucb", "alike", cost=2.0),
    "gp-thompson": Learner("gp", "thompson", cost=2.0),
    "gp-progress": Learner("gp", "progress", cost=2.0),
    "gp-ucb-spread": Learner("gp", "ucb", "spread", cost=2.0),
}
RECOMMENDED = "gp-ucb-alike"  # by docs/reaching.md
PUBLISHED = "published"
