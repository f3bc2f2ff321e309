"""The learned reaches of a run, put to use: nothing is learned or written."""

from __future__ import annotations

import numpy as np

from mobee.learning.reaching.acting import move
from mobee.learning.reaching.failures import has_failed
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import ReachTarget


def go_to_pre_reach(agent: ReachAgent, target: ReachTarget) -> tuple[tuple[int, ...], tuple[tuple[int, int], ...], float]:
    """Go where reaching for a target is worth most; the states gone through, what was avoided, and the reward expected there.

    Transitions that fail are remembered by the agent until its end, and planned around.
    """
    state = agent.state
    path, avoided = [state], dict[tuple[int, int], None]()
    for _ in range(agent.limit - 1):
        plan = agent.plan(target, state)
        avoided.update(dict.fromkeys(plan.avoided))
        if not plan.actions:
            break
        expected = np.maximum(agent.predictor.mean(target.position), 0.0)
        values, _ = agent.planning.values(expected, agent.failures.rewards(target.position))
        action = plan.actions[0]
        _, following = move(agent.plant, agent.space, state, action)
        if has_failed(values, state, following):
            agent.failures.add(state, action, target.position, agent.penalty)
        state = following
        path.append(state)
    return tuple(path), tuple(avoided), float(agent.predictor.mean(target.position)[state])
