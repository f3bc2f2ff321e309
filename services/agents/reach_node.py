"""Runs an agent that learns to reach on the live plant: chooses the target least tried, plans, reaches, publishes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mobee import ReachTarget
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.learning.record import load_learned
from mobee.robot.robot import Robot
from mobee.store import STORE
from services.agents.config import Config
from services.agents.reach_stream import ReachStream
from services.agents.work import Work
from services.common.bus_plant import BusPlant
from services.common.hands import hand_of
from services.common.service import Service


class ReachNode:
    """A reach agent on the live plant; every action is on disk before the next."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._config = config
        self._targets = [ReachTarget(np.array(place), config.target_radius) for place in config.targets]
        plant = BusPlant(service, robot, (config.part,))
        known = load_learned(Path(config.learned) / STORE, config.part, robot) if config.learned else None
        self._agent = ReachAgent(
            config.space(robot) if known is None else known.space,
            plant,
            None if known is None else known.model.debiased(),
            marker=config.marker or hand_of(robot, config.part),
            settings=config.reaching(),
            store=ReachStore(Path(config.run_dir) / STORE, config.part) if config.run_dir else None,
        )
        self._told = ReachStream(service.bus, self._agent)
        self._work = Work(service, plant)
        self._mark()
        service.mark, service.describe = self._mark, self._describe

    def run(self) -> None:
        """Make problem-tries until there are as many as wanted."""
        agent, wanted = self._agent, self._config.tries
        resumed = f"{self._config.part} goes on after {agent.tries} problem-tries" if agent.steps else ""
        self._work.run(resumed, lambda: 0 < wanted <= agent.tries, self._try)

    def _try(self) -> None:
        agent = self._agent
        if agent.under_way is None:
            target = agent.problems.least_tried(self._targets, agent.problem_draws())
        else:
            target = agent.problems.targets[agent.under_way]
        agent.begin(target)
        agent.plant.present(target)
        while agent.under_way is not None:
            plan = agent.planned()
            self._told.put(agent.step(), target, plan)
        made = agent.last
        if made is None:
            return
        self._made += 1
        self._failures += made.failures
        self._reached += made.reach_state is not None
        self._rewards += made.reward
        self._missing += made.missing

    def _mark(self) -> None:
        self._made = self._failures = self._reached = self._work.interrupted = 0
        self._rewards = self._missing = 0.0

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "tries": self._made,
            "tries_ever": self._agent.tries,
            "reaches": self._reached,
            "failures": self._failures,
            "interrupted": self._work.interrupted,
            "reward_mean": self._rewards / self._made if self._made else -1.0,
            "missing_mean": self._missing / self._reached if self._reached else -1.0,
        }
        return f"{self._agent.tries} problem-tries, {self._made} now", numbers
