"""Publishes the tries of a reach agent, in the messages of a curious agent where they fit."""

from __future__ import annotations

import numpy as np

from bus_schema.messages import Transition as TransitionMessage
from mobee import ReachTarget, TransitionModel
from mobee.arrays import Array
from mobee.learning.reaching.planning import REACH
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.tries import Step
from services.agents.learned import LearnedStream
from services.agents.work import tell
from services.common.bus import Bus


class ReachStream:
    """Puts a `Transition` after each transition, and `Learned` with what it learns of these; of a reach the controller tells (`Reach`)."""

    def __init__(self, bus: Bus, agent: ReachAgent) -> None:
        self._agent, self._seen, self._count = agent, TransitionModel(agent.space), 0
        for step in agent.store.load() if agent.store is not None else []:
            self._note(step)
        self._transitions = bus.publisher(TransitionMessage, agent.part)
        self._learned = LearnedStream(bus, self._seen)

    def put(self, step: Step, target: ReachTarget, plan: tuple[Array, Array]) -> None:
        """Tell of a step toward a target, with the values V (S,) and Q (S, A + 1) of the plan that it was part of."""
        values, action_values = plan
        self._note(step)
        if step.a != REACH:
            tell(self._transitions, self._agent.space, self._count, step, float(values[step.s]))

        def numbers() -> tuple[Array, Array]:
            value = action_values[:, :-1]
            return np.where(np.isneginf(value), value, self._agent.failures.rewards(target.position)), value

        self._learned.put(self._count, step.s_next, numbers)

    def _note(self, step: Step) -> None:
        if step.a != REACH:
            self._seen.observe(step.s, step.a, step.s_next)
            self._count += 1
