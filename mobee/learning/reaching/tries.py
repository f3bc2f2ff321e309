# SPDX-License-Identifier: Apache-2.0
"""Problems (targets), problem-tries and their steps (thesis 8.3.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobee.errors import InvalidValue
from mobee.learning.reaching.planning import REACH
from mobee.reach import ReachTarget


class Problems:
    """Targets by number, in the order of their first problem-tries, and how often each was tried."""

    def __init__(self) -> None:
        self.targets: list[ReachTarget] = []
        """The first target given for each problem."""
        self.tries: list[int] = []
        """Number of ended problem-tries of each problem."""
        self._known: dict[bytes, int] = {}

    def __len__(self) -> int:
        return len(self.targets)

    def index(self, target: ReachTarget) -> int:
        """Return the number of the problem at the target's position; a new position is a new problem."""
        number = self._known.setdefault(place(target), len(self.targets))
        if number == len(self.targets):
            self.targets.append(target)
            self.tries.append(0)
        return number

    def least_tried(self, targets: Sequence[ReachTarget], rng: np.random.Generator) -> ReachTarget:
        """Return the target tried least often, drawn among equals (thesis 8.3.2); raises InvalidValue if there is none."""
        if not targets:
            raise InvalidValue("there are no problems to choose from: give at least one target.")
        tries = [self.tries[n] if (n := self._known.get(place(target))) is not None else 0 for target in targets]
        least = min(tries)
        equal = [target for target, count in zip(targets, tries, strict=True) if count == least]
        return equal[int(rng.integers(len(equal)))]


def place(target: ReachTarget) -> bytes:
    """Return the key of a problem: its position."""
    return (target.position + 0.0).tobytes()  # -0 and 0 are one position


@dataclass(frozen=True, slots=True)
class Step:
    """One action of a problem-try.

    `n`: number of the step, 1, 2, ...  `number`: of its problem-try, 1, 2, ...  `problem`: of the target, 0, 1, ...  `s`, `s_next`: states
    before and after.  `a`: the action of a transition, or REACH.  `failed`: the transition did not lead to a state of higher value.
    `reward`: of a transition 0 or the penalty, of a reach that of thesis eq. 8.4.  `expected`, `missing`: of a reach, the reward predicted
    just before, and the remaining error [m].  `settled`: False after a timeout.  `duration`: s, by the plant's clock.  `q`: rad, all
    motors of the part at the end; of a reach, when its force ended.  `touched`: world objects in contact.
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
    """A problem-try that has ended.

    `number`: 1, 2, ...  `problem`: number of its target.  `path`: its transitions, as (s, a, s', failed).  `reach_state`: where the reach
    started; None: the try ended at the limit of actions without a reach.  `reward`, `expected`: observed and predicted reward of the reach;
    `intrinsic`: expected minus observed reward (thesis eq. 8.6); `missing`: m, remaining error.  These four are 0 without a reach.
    `timeouts`: number of actions that did not settle.  `duration`: s, by the plant's clock.
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
        """Number of its transitions that failed."""
        return sum(failed for _, _, _, failed in self.path)


def made_of(steps: Sequence[Step]) -> Try:
    """Return the problem-try that consists of these steps, at least one."""
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
