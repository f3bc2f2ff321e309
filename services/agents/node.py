"""Runs a curious agent on the live plant."""

from __future__ import annotations

from pathlib import Path

from bus_schema.messages import Transition as TransitionMessage
from mobee import CuriousAgent
from mobee.robot.robot import Robot
from mobee.store import STORE, TransitionStore
from services.agents.config import Config
from services.agents.learned import LearnedStream
from services.agents.work import Work, tell
from services.common.bus_plant import BusPlant
from services.common.service import Service


class AgentNode:
    """A curious agent on the live plant; every transition is on disk before the next action."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._config = config
        self._store = TransitionStore(Path(config.run_dir) / STORE, config.part) if config.run_dir else None
        plant = BusPlant(service, robot, (config.part,))
        self._agent = CuriousAgent(config.space(robot), plant, settings=config.curious(), store=self._store)
        self._stream = service.bus.publisher(TransitionMessage, config.part)
        self._learned = LearnedStream(service.bus, self._agent.model)
        self._work = Work(service, plant)
        self._mark()
        service.mark, service.describe = self._mark, self._describe

    def run(self) -> None:
        """Act until the wanted number of transitions is made."""
        agent, wanted = self._agent, self._config.transitions
        resumed = f"{self._config.part} goes on after {agent.transitions} transitions" if agent.transitions else ""
        self._work.run(resumed, lambda: 0 < wanted <= agent.transitions, self._step)

    def _step(self) -> None:
        state = self._agent.state
        values, _ = self._agent.plan()
        value = float(values[state])
        self._agent.step()
        made = self._agent.last
        if made is None:
            return
        self._made += 1
        self._timeouts += not made.settled
        self._seconds += made.duration
        tell(self._stream, self._agent.space, made.n, made, value)
        agent = self._agent
        self._learned.put(agent.transitions, agent.state, lambda: (agent.model.reward, agent.plan()[1]))

    def _mark(self) -> None:
        self._made = self._timeouts = self._work.interrupted = 0
        self._seconds = 0.0

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "transitions": self._made,
            "transitions_ever": self._agent.transitions,
            "timeouts": self._timeouts,
            "interrupted": self._work.interrupted,
            "action_time_mean": self._seconds / self._made if self._made else -1.0,
        }
        return f"{self._agent.transitions} transitions, {self._made} now", numbers
