"""What a learner would do to reach for a target, before it does it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.learning.reaching.learner import ReachLearner
from mobee.reach import ReachTarget
from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True)
class ReachPlan:
    """A way to a state and the reach from there.

    `path`: states from start to the pre-reach state.  `actions`: what to do in each but the last.  `probabilities`: that each ends
    where the path says; `success`: that all of them do.  `state`: from which to reach.  `expected`: the reward then (thesis eq. 8.4).
    `avoided`: transitions, as (state, goal), that the way would consist of but for failures remembered.
    """

    path: tuple[int, ...]
    actions: tuple[int, ...]
    probabilities: tuple[float, ...]
    success: float
    state: int
    expected: float
    avoided: tuple[tuple[int, int], ...]


def way_to_reach(learner: ReachLearner, target: ReachTarget, start: int) -> ReachPlan:
    """The way on which a learner expects most, from a state; raises InvalidValue if the space has no such state."""
    learner.space.actions(start)
    expected = np.maximum(learner.predictor.mean(target.position), 0.0)  # no reward is below 0, and the plan would put off one that is
    failures = learner.failures.rewards(target.position)
    path, actions, probabilities = _walk(learner, start, *learner.planning.values(expected, failures))
    freely, chosen, _ = _walk(learner, start, *learner.planning.values(expected, 0.0))
    taken = set(zip(path, actions, strict=False))
    avoided = [(s, a) for s, a in zip(freely, chosen, strict=False) if failures[s, a] < 0.0 and (s, a) not in taken]
    return ReachPlan(
        path=tuple(path),
        actions=tuple(actions),
        probabilities=tuple(probabilities),
        success=float(np.prod(probabilities)),
        state=path[-1],
        expected=float(expected[path[-1]]),
        avoided=tuple((s, learner.space.goal(s, a)) for s, a in avoided),
    )


def _walk(learner: ReachLearner, start: int, values: Array, action_values: Array) -> tuple[list[int], list[int], list[float]]:
    """Follow the best actions through their likeliest outcomes that are worth more, until reaching is best."""
    path, actions, chances = [start], list[int](), list[float]()
    best = action_values.argmax(axis=1)
    while best[path[-1]] != action_values.shape[1] - 1:
        here, action = path[-1], int(best[path[-1]])
        outcomes, probabilities = learner.planning.outcomes[here, action], learner.planning.probabilities[here, action]
        nearer = np.where(values[outcomes] > values[here], probabilities, 0.0)
        if not nearer.any():
            break  # nothing is worth going for
        likeliest = int(nearer.argmax())
        path.append(int(outcomes[likeliest]))
        actions.append(action)
        chances.append(float(probabilities[likeliest]))
    return path, actions, chances
