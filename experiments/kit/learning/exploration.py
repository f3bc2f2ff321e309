# SPDX-License-Identifier: Apache-2.0
"""Exploration by one agent, or by several at the same time, and the record of their transitions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mobee import CuriousAgent, OfflinePlant, Plant, Space
from mobee.arrays import Array, Ints
from mobee.errors import MobeeError
from mobee.store import Transition


def begin_anywhere(space: Space, plant: OfflinePlant, seed: int) -> None:
    """Move the space's part of the robot towards a random state; no agent learns from this motion.

    The published runs begin with such a motion.  `seed`: seed of the choice of the state.
    """
    plant.act(space.part, space.target(int(np.random.default_rng(seed).integers(len(space)))))


def begin_nearby(space: Space, plant: Plant, seed: int) -> int:
    """Move the space's part of the robot to a random neighbour of its present state, and return the number of the state that was reached.

    No agent learns from this motion, because it may start anywhere in the cell of a state.  After it, an agent's first action starts where
    an action ended, as all later ones do.  `seed`: seed of the choice of the neighbour.
    """
    state = space.state_of(plant.measure(space.part))
    goal = int(np.random.default_rng(seed).choice(space.actions(state)))
    return space.state_of(plant.act(space.part, space.target(goal)).q)


def newest(agent: CuriousAgent) -> Transition:
    """Return the last transition of an agent; raises MobeeError if it has made none."""
    if agent.last is None:
        raise MobeeError(f"the agent of {agent.part} has observed nothing yet: let it make a step first.")
    return agent.last


def explore(agent: CuriousAgent, most: int, enough: Callable[[CuriousAgent], bool] = lambda agent: False) -> Ints:
    """Let an agent make up to `most` transitions, and return them, (T, 3): state, action, state reached.

    `enough`: function of the agent that is called before each transition; the agent stops when it returns True.
    """
    seen: list[tuple[int, int, int]] = []
    while len(seen) < most and not enough(agent):
        agent.step()
        last = newest(agent)
        seen.append((last.s, last.a, last.s_next))
    return np.array(seen, dtype=np.int64).reshape(-1, 3)


class LeastTries:
    """A stopping criterion for `explore`: every state-action was tried at least `least` times.

    `state_actions`: number of state-actions.  The tries are counted incrementally, so it must be called after every transition.
    """

    def __init__(self, least: int, state_actions: int) -> None:
        self._least, self._left = least, state_actions

    def __call__(self, agent: CuriousAgent) -> bool:
        """Return whether the criterion is met; must be called after every transition of the agent."""
        if agent.last is not None and agent.model.tries[agent.last.s, agent.last.a] == self._least:
            self._left -= 1
        return self._left == 0


@dataclass(eq=False)
class Log:
    """The T transitions of one part, as lists of length T.

    `seen`: state, action, state reached.  `settled`: whether the motors came to rest before the time limit of the action.  `durations`: s.
    `ends`: plant time, s.  `touched`: names of the world objects in contact at the end.  `poses`: positions of all motors at the end, (n,)
    rad.
    """

    seen: list[tuple[int, int, int]] = field(default_factory=list)
    settled: list[bool] = field(default_factory=list)
    durations: list[float] = field(default_factory=list)
    ends: list[float] = field(default_factory=list)
    touched: list[tuple[str, ...]] = field(default_factory=list)
    poses: list[Array] = field(default_factory=list)

    def arrays(self, part: str, count: int) -> dict[str, Any]:
        """Return seen, settled, durations and ends of the first `count` transitions as arrays.

        The keys end with the name `part`, as "seen_left_arm".
        """
        return {
            f"seen_{part}": np.array(self.seen[:count], dtype=np.uint16),
            f"settled_{part}": np.array(self.settled[:count], dtype=bool),
            f"durations_{part}": np.array(self.durations[:count], dtype=np.float32),
            f"ends_{part}": np.array(self.ends[:count], dtype=np.float64),
        }


def explore_together(agents: Sequence[CuriousAgent], plant: OfflinePlant, transitions: int) -> dict[str, Log]:
    """Let several agents act at the same time on one plant, as `mobee.run` does, and return the transitions of each part.

    The run ends when every agent has made `transitions` transitions; faster agents make more in the meantime.
    """
    logs = {agent.part: Log() for agent in agents}
    by_part, waiting = {agent.part: agent for agent in agents}, list(agents)
    while min(len(log.seen) for log in logs.values()) < transitions:
        for agent in waiting:
            plant.begin(agent.part, agent.target(agent.decide(agent.state)))
        waiting = []
        for part, outcome in plant.advance():
            agent, log = by_part[part], logs[part]
            agent.observe(outcome)
            last = newest(agent)
            log.seen.append((last.s, last.a, last.s_next))
            log.settled.append(outcome.settled)
            log.durations.append(outcome.duration)
            log.ends.append(plant.time)
            log.touched.append(outcome.touched)
            log.poses.append(plant.q)
            waiting.append(agent)
    return logs
