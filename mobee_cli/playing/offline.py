# SPDX-License-Identifier: Apache-2.0
"""Lets agents learn offline, many times faster than real time, and reports their progress at intervals."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.kit.command_line import Progress
from mobee.control.law import largest_step
from mobee.errors import MobeeError
from mobee.learning.agent import CuriousAgent, run
from mobee.model.model import Model
from mobee.robot.robot import Robot
from mobee.simulation.plant import OfflinePlant
from mobee.store import Transition, TransitionStore
from mobee_cli.playing.files import Files, require_same_robot
from mobee_cli.playing.setup import Setup
from services.common.worlds import world_around

CHUNK = 10  # transitions between two checks of the clock
TICKS = (0.02, 0.01, 0.005)  # s: the longest at which the gains are stable is the control tick
FIRST_REPORT = 5.0  # min of robot time; the next report follows after twice the time, and so on


@dataclass(slots=True, eq=False)
class Learning:
    """Agents that learn on one offline plant.

    `begun`: number of transitions in the file of the agents at the start. `seconds`: real time of learning so far [s].
    """

    plant: OfflinePlant
    agents: tuple[CuriousAgent, ...]
    begun: int
    seconds: float = 0.0

    @property
    def touched(self) -> Counter[str]:
        """For each object of the world, by name, the number of actions that ended in contact with it."""
        return Counter(name for agent in self.agents for made in _made(agent) for name in made.touched)

    @property
    def transitions(self) -> int:
        """The number of transitions made since the start of this process."""
        return sum(agent.transitions for agent in self.agents) - self.begun

    @property
    def kept(self) -> int:
        """The number of transitions in the file of the agents, including those of earlier processes."""
        return sum(len(_made(agent)) for agent in self.agents)

    def numbers(self) -> dict[str, Any]:
        """Return the numbers of the learning so far, as plain JSON data.

        These are of this process only: "transitions": number of transitions. "robot_time_s": simulated time. "real_time_s": real time. The
        other numbers include earlier processes: "transitions_ever": number of all transitions. "touched": number of actions that ended in
        contact with each object, by name. "agents": for each part, a dict with "joints" (names) and the numbers "states", "state_actions",
        "tried" (state-actions that were tried), "missed_goal" (state-actions that missed their goal at least once) and "transitions".
        """
        return {
            "transitions": self.transitions,
            "transitions_ever": self.transitions + self.begun,
            "robot_time_s": round(self.plant.time, 3),
            "real_time_s": round(self.seconds, 3),
            "touched": dict(self.touched),
            "agents": {agent.part: _of_agent(agent) for agent in self.agents},
        }

    def summary(self) -> str:
        """Return one line with the number of transitions, the robot's time and the speed (robot's time divided by real time)."""
        speed = self.plant.time / self.seconds if self.seconds else 0.0
        return f"{self.transitions} transitions, {self.plant.time / 60.0:.0f} min of robot time, {speed:.0f} x real time"

    def report(self) -> str:
        """Return one line with the progress of learning.

        The line contains the number of state-actions that were tried, the number of those that missed their goal at least once, and the
        object that was touched most.
        """
        tried = sum(int((agent.model.tries > 0).sum()) for agent in self.agents)
        every = sum(agent.space.state_actions for agent in self.agents)
        surprised = sum(_surprises(agent) for agent in self.agents)
        contacts = "".join(f"; {name} touched {count} times" for name, count in self.touched.most_common(1))
        return f"{self.plant.time / 60.0:5.0f} min: {tried} of {every} actions tried, {surprised} miss their goals{contacts}"


def _surprises(agent: CuriousAgent) -> int:
    """Return how many of the state-actions that were tried have ended in another state than their goal at least once."""
    return len({(made.s, made.a) for made in _made(agent) if made.s_next != agent.space.goal(made.s, made.a)})


def _made(agent: CuriousAgent) -> list[Transition]:
    return agent.store.load() if agent.store is not None else []


def _of_agent(agent: CuriousAgent) -> dict[str, Any]:
    return {
        "joints": list(agent.space.joints),
        "states": len(agent.space),
        "state_actions": agent.space.state_actions,
        "tried": int((agent.model.tries > 0).sum()),
        "missed_goal": _surprises(agent),
        "transitions": agent.transitions,
    }


@contextmanager
def opened(setup: Setup, robot: Robot, store: Path) -> Iterator[Learning]:
    """Create the agents of a setup on an offline plant, for the block of a `with` statement. Raises MobeeError if this is not possible.

    An offline plant is a simulated robot in this process. `setup`: the settings of the agents, the world and the gains. `robot`: the robot,
    loaded from the same file or name as in the live system, so that offline and live learning have exactly the same state spaces. `store`:
    file of the transitions. The agents first learn the transitions that it already contains.
    """
    model = Model(robot, world_around(setup.world, setup.shipped or store))
    learners = {part: (config.space(robot), config.curious()) for part, config in setup.agents.items()}  # before a store is made
    dt = next((tick for tick in TICKS if tick < largest_step(robot, setup.law)), TICKS[-1])
    store.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as open_meanwhile:
        stores = {part: open_meanwhile.enter_context(TransitionStore(store, part, durable=False)) for part in setup.agents}
        for one in stores.values():
            _require_robot(one, robot.name)
        if not setup.shipped:
            require_same_robot(robot, Files(store))  # before the agent of a new part is recorded
        begun = sum(len(one.load()) for one in stores.values())
        seed = next(iter(setup.agents.values())).seed
        plant = OfflinePlant(model, seed + begun, setup.law, dt=dt, active=list(setup.agents))
        agents = tuple(CuriousAgent(space, plant, settings=settings, store=stores[part]) for part, (space, settings) in learners.items())
        yield Learning(plant, agents, begun)


def _require_robot(store: TransitionStore, name: str) -> None:
    """Raise MobeeError if an agent in the file of a store, of any part, was recorded with a robot that has another name."""
    for agent in store.agents():
        recorded = store.settings(agent).get("space", {}).get("robot", name)
        if recorded != name:
            raise MobeeError(f"{store.path} has transitions of robot {recorded!r}, not {name!r}: name this robot, or use another file.")


def learn(learning: Learning, seconds: float | None, transitions: int | None, say: Callable[[str], None]) -> None:
    """Let the agents learn until one of two limits is reached.

    `seconds`: real time of learning [s]; None: no limit of time. `transitions`: total number of transitions in the file of the agents;
    None: no limit of transitions. `say`: called with the text of each report, the first after 5 min of robot time. On a terminal a progress
    bar is shown.
    """
    start, following = time.monotonic(), FIRST_REPORT
    with Progress() as progress:
        while True:
            ever = learning.begun + learning.transitions
            learning.seconds = time.monotonic() - start
            if transitions is not None and ever >= transitions or seconds is not None and learning.seconds >= seconds:
                return
            shares = [ever / transitions if transitions else 0.0, learning.seconds / seconds if seconds else 0.0]
            progress.show(max(shares), learning.summary())
            run(learning.agents, CHUNK if transitions is None else min(CHUNK, transitions - ever))
            if learning.plant.time / 60.0 >= following:
                progress.clear()
                say(learning.report())
                following *= 2.0
