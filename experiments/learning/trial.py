"""An agent let loose until it knows enough, and the record of what it did."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mobee import CuriousAgent, OfflinePlant, Plant, Space
from mobee.errors import MobeeError
from mobee.robot.robot import Ints
from mobee.store import Transition


def begin_anywhere(space: Space, plant: OfflinePlant, seed: int) -> None:
    """Bring the part into a random state, as the published runs began; what it does on the way is not observed."""
    plant.act(space.part, space.target(int(np.random.default_rng(seed).integers(len(space)))))


def begin_nearby(space: Space, plant: Plant, seed: int) -> int:
    """Go to a random neighbour of the state the part is in, unobserved: that action begins at no sample; returns the state."""
    state = space.state_of(plant.measure(space.part)[space.columns])
    goal = int(np.random.default_rng(seed).choice(space.actions(state)))
    return space.state_of(plant.act(space.part, space.target(goal)).q[space.columns])


def newest(agent: CuriousAgent) -> Transition:
    """What the agent observed last; raises MobeeError if it has observed nothing."""
    if agent.last is None:
        raise MobeeError(f"the agent of {agent.part} has observed nothing yet: let it make a step first.")
    return agent.last


def explore(agent: CuriousAgent, most: int, enough: Callable[[CuriousAgent], bool] = lambda agent: False) -> Ints:
    """Observe up to that many transitions, fewer when the agent knows `enough`; returns (T, 3): state, action, state reached."""
    seen: list[tuple[int, int, int]] = []
    while len(seen) < most and not enough(agent):
        agent.step()
        last = newest(agent)
        seen.append((last.s, last.a, last.s_next))
    return np.array(seen, dtype=np.int64).reshape(-1, 3)


class LeastTries:
    """Whether every state-action was tried at least `least` times, counted on as the agent goes."""

    def __init__(self, least: int, state_actions: int) -> None:
        self._least, self._left = least, state_actions

    def __call__(self, agent: CuriousAgent) -> bool:
        """Ask after every transition."""
        if agent.last is not None and agent.model.tries[agent.last.s, agent.last.a] == self._least:
            self._left -= 1
        return self._left == 0
