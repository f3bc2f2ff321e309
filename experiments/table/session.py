"""Three agents let loose at the table together, and the record of what each did."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from experiments.learning.trial import newest
from mobee import CuriousAgent, OfflinePlant
from mobee.robot.robot import Array


@dataclass(eq=False)
class Log:
    """One part's transitions; `poses` are those of all motors at their ends, (n,) rad."""

    seen: list[tuple[int, int, int]] = field(default_factory=list)
    settled: list[bool] = field(default_factory=list)
    durations: list[float] = field(default_factory=list)  # s
    ends: list[float] = field(default_factory=list)  # s of plant time
    poses: list[Array] = field(default_factory=list)

    def arrays(self, part: str, count: int) -> dict[str, Any]:
        """The first `count` of everything but the poses, under names that end in the part's."""
        return {
            f"seen_{part}": np.array(self.seen[:count], dtype=np.uint16),
            f"settled_{part}": np.array(self.settled[:count], dtype=bool),
            f"durations_{part}": np.array(self.durations[:count], dtype=np.float32),
            f"ends_{part}": np.array(self.ends[:count], dtype=np.float64),
        }


def explore_together(agents: Sequence[CuriousAgent], plant: OfflinePlant, transitions: int) -> dict[str, Log]:
    """Act as `mobee.run` does until every agent has made that many transitions; the faster ones go on meanwhile."""
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
            log.poses.append(np.concatenate([plant.measure(name) for name in plant.robot.parts]))
            waiting.append(agent)
    return logs
