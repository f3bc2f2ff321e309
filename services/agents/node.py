# SPDX-License-Identifier: Apache-2.0
"""Runs an agent on the live plant: a curious agent, or one that learns to reach."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bus_schema import VERSION, keys
from bus_schema.messages import Decision
from bus_schema.messages import Transition as TransitionMessage
from bus_schema.rpc import Done, Empty, Explore
from mobee import ActionInterrupted, CuriousAgent, MobeeError, ReachTarget
from mobee.learning.explorers import EXPLORERS
from mobee.learning.object_space import ObjectSpace
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.learning.record import load_learned
from mobee.robot.robot import Robot
from mobee.store import STORE, Transition, TransitionStore, store_of
from services.agents.config import Config
from services.agents.object_plant import ObjectPlant
from services.agents.store_wait import StoreWait
from services.agents.streams import LearnedStream, ReachStream, publish_decision, publish_transition
from services.common.bus_plant import BusPlant
from services.common.hands import hand_of
from services.common.rate import NOT_MEASURED
from services.common.service import CallRefused, Service

PRESENT_PERIOD = 1.0  # s between attempts to present a target that the model does not accept


class Work:
    """The main loop of an agent's process.

    `interrupted`: number of interrupted actions since the launcher last began a measurement. On request the agent rests: it releases the
    goal of its part, so that another client can move the part, until it is asked to continue.
    """

    def __init__(self, service: Service, plant: BusPlant, part: str) -> None:
        self._service, self._plant, self._part = service, plant, part
        self.interrupted = 0
        service.on_request(keys.service_rpc(service.who, "rest"), Empty, self._rest)
        service.on_request(keys.service_rpc(service.who, "resume"), Empty, self._resume)

    def run(self, resumed: str, enough: Callable[[], bool], step: Callable[[], None]) -> None:
        """Call `step` until `enough()` returns True, and answer the calls of other processes between the steps.

        If `step` raises ActionInterrupted, this is counted and published as an event, and the next step begins. `resumed`: text of an event
        that is published first, if the agent continues from stored data; empty: no event, because there are no stored data.
        """
        self._service.ready()
        if resumed:
            self._service.bus.event("info", "resumed", resumed)
        while not enough():
            try:
                step()
            except ActionInterrupted as interruption:
                self.interrupted += 1
                self._service.bus.event("warning", "interrupted", str(interruption))
            self._service.spin(time.monotonic())
            while self._plant.idle():
                continue
        if self._service.locked:
            self._plant.leave()

    def _rest(self, request: Empty, key: str) -> Done:
        """Release the goal at once: the action under way ends as interrupted, and is not learned from."""
        self._plant.rest()
        self._service.bus.event("info", "rests", f"{self._part}: its agent rests, as {request.who} asked")
        return Done(v=VERSION)

    def _resume(self, request: Empty, key: str) -> Done:
        self._plant.resume()
        return Done(v=VERSION)


class AgentNode:
    """Runs a curious agent on the live plant, the running robot.

    If the run has a folder, every transition is on disk before the next action begins.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._config = config
        self._wait = wait = StoreWait(service)
        store = wait.until_accepted(lambda: TransitionStore(Path(config.run_dir) / STORE, config.part)) if config.run_dir else None
        plant = BusPlant(service, robot, (config.part,))
        continued = store_of(Path(config.continues)) if config.continues else None
        space, settings = config.space(robot), config.curious()
        self._object = ObjectPlant(service, plant, config, space) if isinstance(space, ObjectSpace) else None
        seeing = self._object or plant
        self._agent = wait.until_accepted(lambda: CuriousAgent(space, seeing, settings=settings, store=store, continues=continued))
        if store is not None:
            wait.let_append_wait(store)
        self._stream = service.bus.publisher(TransitionMessage, config.part)
        self._decisions = service.bus.publisher(Decision, config.part)
        self._learned = LearnedStream(service.bus, self._agent.model)
        self._work = Work(service, plant, config.part)
        self._bus = service.bus
        service.on_request(keys.service_rpc(service.who, "explore"), Explore, self._explore)
        self._mark()
        service.mark, service.describe = self._mark, self._describe

    def run(self) -> None:
        """Act until the configured number of transitions is made; 0: without end."""
        agent, wanted = self._agent, self._config.transitions
        resumed = f"{self._config.part} continues after {agent.transitions} transitions" if agent.transitions else ""
        self._work.run(resumed, lambda: 0 < wanted <= agent.transitions, self._step)

    def _explore(self, request: Explore, key: str) -> Done:
        """Change the agent's explorer, which chooses the next actions; the agent's store records the change, and an event reports it.

        Raises CallRefused if there is no such explorer, or if the agent has a goal that the explorer ignores.
        """
        valid = (*EXPLORERS, self._agent.settings["explorer"])
        if request.explorer not in valid:  # a call imports no code
            raise CallRefused("explorer", f"no explorer {request.explorer!r}; valid: {', '.join(valid)}")
        try:
            self._agent.explore_by(request.explorer)
        except MobeeError as error:
            raise CallRefused("explorer", str(error)) from None
        text = f"{self._config.part} explores by {self._agent.explorer} from now on, as {request.who} asked"
        self._bus.event("info", "explorer", text)
        return Done(v=VERSION)

    def _step(self) -> None:
        agent = self._agent
        state = agent.state
        value, action = float(agent.plan()[0][state]), agent.decide(state)
        if not self._made:
            self._publish_learned()
        publish_decision(self._decisions, agent, state, action)
        believed = agent.beliefs.probabilities[state, action].copy()
        outcomes = agent.beliefs.outcomes[state, action].copy()
        agent.act()
        made = agent.last
        if made is None:
            return
        self._made += 1
        self._timeouts += not made.settled
        self._moves += self._moved_object(made)
        self._seconds += made.duration
        publish_transition(self._stream, agent.space, made.n, made, value, float(believed[outcomes == made.s_next].sum()))
        self._publish_learned()

    def _moved_object(self, made: Transition) -> bool:
        """Return whether the object was in another cell after a transition."""
        space = self._agent.space
        return isinstance(space, ObjectSpace) and space.cell(made.s) != space.cell(made.s_next)

    def _publish_learned(self) -> None:
        agent = self._agent
        self._learned.put(agent.transitions, agent.state, lambda: (agent.model.reward, agent.plan()[1]))

    def _mark(self) -> None:
        self._made = self._timeouts = self._moves = self._work.interrupted = 0
        self._seconds = 0.0
        if self._object is not None:
            self._object.absences = self._object.retreats = 0

    def _describe(self) -> tuple[str, dict[str, float]]:
        numbers = {
            "transitions": self._made,
            "transitions_ever": self._agent.transitions,
            "timeouts": self._timeouts,
            "interrupted": self._work.interrupted,
            "action_time_mean": self._seconds / self._made if self._made else NOT_MEASURED,
        }
        text, seen = f"{self._agent.transitions} transitions, {self._made} now", self._object
        if seen is not None:
            numbers |= {"object_moves": self._moves, "object_absences": seen.absences, "retreats": seen.retreats}
            text = f"{'waits until its object is back; ' if seen.is_absent else ''}{text}"
        return f"{self._wait.status_prefix()}{text}", numbers


class ReachNode:
    """Runs an agent that learns to reach on the live plant, the running robot.

    If the run has a folder, every step (a transition or a reach) is on disk before the next one begins.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._config = config
        self._targets = [ReachTarget(np.array(place), config.target_radius) for place in config.targets]
        self._plant = plant = BusPlant(service, robot, (config.part,))
        known = load_learned(Path(config.learned) / STORE, config.part, robot) if config.learned else None
        self._wait = wait = StoreWait(service)
        store = wait.until_accepted(lambda: ReachStore(Path(config.run_dir) / STORE, config.part)) if config.run_dir else None
        self._agent = wait.until_accepted(
            lambda: ReachAgent(
                config.space(robot) if known is None else known.space,
                plant,
                None if known is None else known.model.debiased(),
                marker=config.marker or hand_of(robot, config.part),
                settings=config.reaching(),
                store=store,
            )
        )
        if store is not None:
            wait.let_append_wait(store)
        self._stream = ReachStream(service.bus, self._agent)
        self._work = Work(service, plant, config.part)
        self._mark()
        service.mark, service.describe = self._mark, self._describe

    def run(self) -> None:
        """Make problem-tries (attempts to reach one target) until the configured number is made; 0: without end."""
        agent, wanted = self._agent, self._config.tries
        resumed = f"{self._config.part} continues after {agent.tries} problem-tries" if agent.steps else ""
        self._work.run(resumed, lambda: 0 < wanted <= agent.tries, self._try)

    def _try(self) -> None:
        agent = self._agent
        if agent.under_way is None:
            target = agent.problems.least_tried(self._targets, agent.problem_draws())
        else:
            target = agent.problems.targets[agent.under_way]
        agent.begin(target)
        self._present(target)
        while agent.under_way is not None:
            plan = agent.planned()
            self._stream.put(agent.step(), target, plan)
        made = agent.last
        if made is None:
            return
        self._made += 1
        self._failures += made.failures
        self._reached += made.reach_state is not None
        self._rewards += made.reward
        self._missing += made.missing

    def _present(self, target: ReachTarget) -> None:
        """Present a target; raise ActionInterrupted after a wait if the model does not answer, or another service presents a target."""
        try:
            self._plant.present(target)
        except ActionInterrupted:
            self._plant.pause(PRESENT_PERIOD)  # the next attempt follows at once
            raise

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
            "reward_mean": self._rewards / self._made if self._made else NOT_MEASURED,
            "missing_mean": self._missing / self._reached if self._reached else NOT_MEASURED,
        }
        return f"{self._wait.status_prefix()}{self._agent.tries} problem-tries, {self._made} now", numbers
