"""Runs several agents on one plant; each starts its next action when its own part has settled (thesis 7.4)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Protocol, cast

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.agent import CuriousAgent
from mobee.plant import Outcome, Plant


class ConcurrentPlant(Plant, Protocol):
    """A plant on which actions of several parts may be under way at once."""

    def begin(self, part: str, target: Array) -> None:
        """Start an action of a part; target (n_part,) rad."""

    def advance(self) -> list[tuple[str, Outcome]]:
        """Run until at least one action has ended; returns part and outcome of all that have."""


def run(agents: Sequence[CuriousAgent], transitions: int) -> None:
    """Let agents of different parts act at once on their common plant until they have made so many more transitions in all.

    No action is begun beyond that number, so at the end every part has settled and every transition was observed.
    Raises InvalidValue unless each agent has its own part and all share a plant with `begin` and `advance`.
    """
    plant = _common_plant(agents)
    waiting, begun, ended = list(agents), 0, 0
    by_part = {agent.part: agent for agent in agents}
    while ended < transitions:
        for agent in waiting[: transitions - begun]:
            plant.begin(agent.part, agent.target(agent.decide(agent.state)))
            begun += 1
        waiting = []
        for part, outcome in plant.advance():
            by_part[part].observe(outcome)
            waiting.append(by_part[part])
            ended += 1


def _common_plant(agents: Sequence[CuriousAgent]) -> ConcurrentPlant:
    if not agents:
        raise InvalidValue("no agents given: valid is at least one, each of its own part.")
    plant = agents[0].plant
    if any(agent.plant is not plant for agent in agents):
        raise InvalidValue("the agents act on different plants: give them one plant, or run each with agent.run.")
    shared = [part for part, count in Counter(agent.part for agent in agents).items() if count > 1]
    if shared:
        raise InvalidValue(f"several agents move {shared[0]}: valid is one agent a part.")
    if not (hasattr(plant, "begin") and hasattr(plant, "advance")):
        raise InvalidValue(f"{type(plant).__name__} has no begin and advance: run each agent with agent.run in a process of its own.")
    return cast(ConcurrentPlant, plant)
