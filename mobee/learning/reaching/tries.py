# SPDX-License-Identifier: Apache-2.0
"""Problems (targets), problem-tries (attempts to reach a target), and the steps of which they consist (thesis 8.3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobee.errors import InvalidValue
from mobee.learning.reaching.planning import REACH
from mobee.reach import ReachTarget


class Problems:
    """The targets that were tried, numbered in the order of their first problem-tries, and how often each was tried.

    A problem-try is one attempt to reach one target.
    """

    def __init__(self) -> None:
        self.targets: list[ReachTarget] = []
        """The first target given for each problem."""
        self.tries: list[int] = []
        """Number of ended problem-tries of each problem."""
        self._known: dict[bytes, int] = {}

    def __len__(self) -> int:
        return len(self.targets)

    def index(self, target: ReachTarget) -> int:
        """Return the number of the problem (the target with this position); a new position gets the next number, from 0."""
        number = self._known.setdefault(place(target), len(self.targets))
        if number == len(self.targets):
            self.targets.append(target)
            self.tries.append(0)
        return number

    def least_tried(self, targets: Sequence[ReachTarget], rng: np.random.Generator) -> ReachTarget:
        """Return the target with the fewest problem-tries; if several have equally few, a random one of them (thesis 8.3.2).

        Raises InvalidValue if `targets` is empty. A problem-try is one attempt to reach one target.
        """
        if not targets:
            raise InvalidValue("there are no problems to choose from: give at least one target.")
        tries = [self.tries[n] if (n := self._known.get(place(target))) is not None else 0 for target in targets]
        least = min(tries)
        equal = [target for target, count in zip(targets, tries, strict=True) if count == least]
        return equal[int(rng.integers(len(equal)))]


def place(target: ReachTarget) -> bytes:
    """Return the key under which dicts store a target: the bytes of its position."""
    return (target.position + 0.0).tobytes()  # -0 and 0 are one position


@dataclass(frozen=True, slots=True)
class Step:
    """One action of a problem-try (attempt to reach one target): a transition, or the reach.

    `n`: number of the step, 1, 2, ... `number`: number of its problem-try, 1, 2, ... `problem`: number of its target, 0, 1, ... `s`,
    `s_next`: states before and after. `a`: the action of a transition, or REACH (-1). `failed`: whether a transition led to a state whose
    value in the plan was not higher than that of `s`. `reward`: the reward of a reach (thesis eq. 8.4); for a transition 0, or the penalty
    if it failed. `expected`: the reward predicted before a reach; 0 for a transition. `missing`: m, remaining distance after a reach; 0 for
    a transition. `settled`: False after a timeout. `duration`: s, by the plant's clock. `q`: (n_part,) rad, all motors of the part at the
    end (for a reach: when its force ended). `touched`: names of the world objects that the robot touched at the end.
    """

    n: int
    number: int
    problem: int
    s: int
    a: int
    s_next: int
    failed: bool
    reward: float
    expected: float
    missing: float
    settled: bool
    duration: float
    q: tuple[float, ...]
    touched: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Try:
    """A problem-try (attempt to reach one target) that has ended.

    `number`: its number, 1, 2, ... `problem`: number of its target, 0, 1, ... `path`: its transitions, each as (state, action, next state,
    failed). `reach_state`: the state where the reach started; None: the try ended at the limit of actions without a reach. `reward`,
    `expected`: observed and predicted reward of the reach. `intrinsic`: expected minus observed reward (thesis eq. 8.6). `missing`: m,
    remaining distance after the reach. `reward`, `expected`, `intrinsic` and `missing` are 0 without a reach. `timeouts`: number of actions
    that timed out. `duration`: s, by the plant's clock.
    """

    number: int
    problem: int
    path: tuple[tuple[int, int, int, bool], ...]
    reach_state: int | None
    reward: float
    expected: float
    intrinsic: float
    missing: float
    timeouts: int
    duration: float

    @property
    def failures(self) -> int:
        """The number of transitions of this problem-try (attempt to reach one target) that failed."""
        return sum(failed for _, _, _, failed in self.path)


def made_of(steps: Sequence[Step]) -> Try:
    """Return the problem-try (attempt to reach one target) that consists of these steps, in order; at least one is needed."""
    moves, last = [step for step in steps if step.a != REACH], steps[-1]
    reached = last.a == REACH
    return Try(
        number=last.number,
        problem=last.problem,
        path=tuple((step.s, step.a, step.s_next, step.failed) for step in moves),
        reach_state=last.s if reached else None,
        reward=last.reward if reached else 0.0,
        expected=last.expected if reached else 0.0,
        intrinsic=last.expected - last.reward if reached else 0.0,
        missing=last.missing if reached else 0.0,
        timeouts=sum(not step.settled for step in steps),
        duration=sum(step.duration for step in steps),
    )
