# SPDX-License-Identifier: Apache-2.0
"""Collects the stories of all agents from their messages, as plain data for the page."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from msgspec.structs import replace

from bus_schema.messages import Decision, Learned, Playback, Reach, Transition
from mobee.arrays import Array
from mobee.learning.space import Space
from mobee.learning.value_iteration import surprise_of
from mobee.rendering.palette import Color
from mobee.robot.robot import Robot
from services.monitor.story.baselines import Curve, baselines, outcomes_of
from services.monitor.story.knowledge import Knowledge, knowledge_of
from services.monitor.story.places import MAX_STATES, Spot, base_link, places, shown_spot, space_of
from services.monitor.story.sentences import (
    STRATEGIES,
    expects_sentence,
    outcome_sentence,
    playback_sentence,
    reach_sentence,
    surprise_sentence,
    tries_sentence,
    wants_sentence,
)
from services.monitor.story.words import action_words, title_of

RECENT = 60  # transitions whose surprise is shown
LARGEST_CURVE = 400  # points
GROWTH = 1.1  # in transitions, after which the baselines are simulated again: the agent knows more of their world


@dataclass
class _Agent:
    """The data of one agent that were received so far."""

    part: str
    color: Color
    space: Space | None = None
    settings: str = ""
    where: Array | None = None  # (S, 3) m, see places
    spot: Spot | None = None
    known: Knowledge | None = None
    first: float = 0.0  # nats: the largest information gain ever seen
    decision: Decision | None = None
    explorer: str = ""  # of its newest decision
    last: Transition | None = None
    reach: Reach | None = None
    recent: deque[tuple[float, bool]] = field(default_factory=lambda: deque(maxlen=RECENT))  # surprise, whether the goal was reached
    curve: Curve = field(default_factory=list)
    baselines: dict[str, Curve] = field(default_factory=dict)  # by explorer
    simulated: int = 0  # transitions up to which the baselines were simulated


class Teller:
    """Makes the texts and numbers that the page shows about all agents: actions, outcomes, knowledge, and reaches of their parts.

    A reach is a motion of a marker (named point of a link), such as a palm, to a target.

    `changed`: names of the values that have changed since the last call of `values`.
    """

    def __init__(self, robot: Robot, colors: dict[str, Color]) -> None:
        """Create a teller that has no message of any agent yet; `colors`: colour of each part of the robot."""
        self._robot, self._colors = robot, colors
        self._agents: dict[str, _Agent] = {}
        self._playback: Playback | None = None
        self.changed: set[str] = set()

    @property
    def parts(self) -> list[str]:
        """The parts about which a message has arrived, either from the part's agent, or about a reach of the part."""
        return [part for part in self._colors if part in self._agents]

    def forget_run(self) -> None:
        """Discard the actions and motions in progress, because a new run of the robot has begun."""
        for agent in self._agents.values():
            agent.decision = agent.reach = None
        self._playback = None
        self.changed |= {"cards", "left", "path"}

    def note_decision(self, seen: Decision) -> None:
        """Store the decision of an agent: the action that it has chosen and now begins."""
        agent = self._agent(seen.agent)
        if agent is not None:
            self._drop_playback()
            agent.decision, agent.explorer = seen, seen.explorer
            self.changed |= {"cards", "left"}

    def note_transition(self, seen: Transition) -> None:
        """Store the observed transition of an action that has ended."""
        agent = self._agent(seen.agent)
        if agent is not None:
            agent.last = seen
            if agent.decision is not None and agent.decision.n < seen.n:  # else it is the next one, which arrived before this outcome
                agent.decision = None
                self.changed.add("left")
            agent.recent.append((surprise_of(seen.probability), seen.s_next == seen.goal))
            self.changed.add("cards")

    def note_learned(self, learned: Learned) -> None:
        """Store the knowledge that an agent has published.

        A point is added to the agent's learning curve. The baselines (learning curves of other explorers) are simulated again if the agent
        has made 10 % more transitions since the last simulation.
        """
        agent = self._agent(learned.agent)
        if agent is None:
            return
        if agent.settings != learned.space:
            self._make_space(agent, learned.space)
        if agent.space is None or (known := knowledge_of(learned, agent.space)) is None:
            return
        agent.known = known
        agent.first = max(agent.first, float(known.reward[known.exists].max()))
        if not agent.curve or agent.curve[-1][0] < known.n:
            agent.curve.append((known.n, round(known.tried, 4), round(known.predictable, 4)))
            if len(agent.curve) > LARGEST_CURVE:
                agent.curve = agent.curve[::2]
        if known.n > GROWTH * agent.simulated:
            outcomes = outcomes_of(learned, known, agent.space)
            agent.baselines, agent.simulated = baselines(outcomes, known.exists, known.state, known.n), known.n
            self.changed.add("baselines")
        self.changed |= {"cards", "left", "curves"}

    def note_reach(self, part: str, reach: Reach) -> None:
        """Store the newest message about a reach (motion of a marker of the part to a target), in progress or ended."""
        agent = self._agent(part)
        if agent is not None and agent.reach != reach:
            self._drop_playback()
            agent.reach = reach
            self.changed.add("cards")

    def note_playback(self, seen: Playback) -> None:
        """Store the newest message about a motion along a path in a roadmap (graph of poses). The motion may have ended."""
        self._playback = seen
        self.changed.add("path")

    def note_gone(self, who: str) -> None:
        """Note that the process `who` has ended: if it was moving the robot along a path, this motion counts as interrupted."""
        seen = self._playback
        if seen is not None and seen.src == who and seen.phase == "moving":
            self.note_playback(replace(seen, phase="interrupted"))

    def values(self) -> dict[str, Any]:
        """Return the values that have changed since the last call, by name, as plain JSON data."""
        made = {name: getattr(self, f"_{name}")() for name in sorted(self.changed)}
        self.changed.clear()
        return made

    def _drop_playback(self) -> None:
        """Remove the path of the last motion along a roadmap, unless this motion still runs. Called when the robot does something else."""
        if self._playback is not None and self._playback.phase != "moving":
            self._playback = None
            self.changed.add("path")

    def _agent(self, part: str) -> _Agent | None:
        if part not in self._colors:  # of another robot
            return None
        if part not in self._agents:
            self._agents[part] = _Agent(part, self._colors[part])
            self.changed |= {"cards", "places"}
        return self._agents[part]

    def _make_space(self, agent: _Agent, settings: str) -> None:
        agent.settings, agent.space = settings, space_of(settings, self._robot)
        agent.where = agent.known = None
        agent.curve.clear()
        agent.baselines, agent.simulated = {}, 0
        if agent.space is not None and agent.space.part != agent.part:
            agent.space = None
        if agent.space is not None and len(agent.space) <= MAX_STATES:
            agent.spot = shown_spot(self._robot, agent.part)
            if agent.spot is not None:
                agent.where = places(agent.space, agent.spot, np.clip(self._robot.home, *self._robot.limits.T))
        self.changed.add("places")

    def _cards(self) -> list[dict[str, Any]]:
        return [self._card(self._agents[part]) for part in self.parts]

    def _card(self, agent: _Agent) -> dict[str, Any]:
        decision, last, known, space = agent.decision, agent.last, agent.known, agent.space
        card: dict[str, Any] = {"part": agent.part, "title": title_of(agent.part), "recent": [[round(s, 2), ok] for s, ok in agent.recent]}
        if agent.reach is not None:
            card["reach"] = reach_sentence(agent.reach)
        if known is not None and space is not None:
            card |= {"n": known.n, "states": len(space), "actions": int(known.exists.sum())}
            card |= {"tried": round(known.tried, 4), "predictable": round(known.predictable, 4)}
        if agent.explorer:
            card["explorer"] = agent.explorer
        if decision is not None and space is not None and max(decision.s, decision.goal) < len(space):
            card["now"] = tries_sentence(decision, space, agent.where)
            card["expects"] = expects_sentence(decision)
            card["chooses"] = STRATEGIES.get(decision.explorer, f"by the function {decision.explorer}")
            if known is not None:
                card["wants"] = wants_sentence(decision, known.untried().tolist(), known.exists.sum(axis=1).tolist())
        if last is not None:
            card["last"] = {
                "action": action_words(space, last.s, last.goal) if space is not None and max(last.s, last.goal) < len(space) else "",
                "outcome": outcome_sentence(last),
                "surprise": surprise_sentence(last),
                "reached": last.s_next == last.goal,
                "n": last.n,
            }
        return card

    def _places(self) -> dict[str, Any]:
        return {
            part: {
                "link": base_link(self._robot, part),
                "marker": title_of(agent.spot.name),
                "points": np.round(agent.where, 4).tolist(),
                "tip": {"link": agent.spot.link, "point": np.round(agent.spot.position, 4).tolist()},
            }
            for part, agent in self._agents.items()
            if agent.where is not None and agent.spot is not None
        }

    def _left(self) -> dict[str, Any]:
        found = {}
        for part, agent in self._agents.items():
            if agent.known is None or agent.where is None:
                continue
            known, decision = agent.known, agent.decision
            found[part] = {
                "left": np.round(known.left(agent.first), 3).tolist(),
                "untried": known.untried().tolist(),
                "actions": known.exists.sum(axis=1).tolist(),
                "here": known.state if decision is None else decision.s,
                "path": [] if decision is None else [decision.goal, *decision.plan],
            }
        return found

    def _path(self) -> dict[str, Any]:
        seen = self._playback
        if seen is None:
            return {}
        return {
            "marker": title_of(seen.marker),
            "points": np.round(np.array(seen.path), 4).tolist(),
            "share": round(seen.share, 3),
            "phase": seen.phase,
            "now": playback_sentence(seen),
        }

    def _baselines(self) -> dict[str, Any]:
        return {part: agent.baselines for part, agent in self._agents.items() if agent.baselines}

    def _curves(self) -> dict[str, Any]:
        return {part: agent.curve for part, agent in self._agents.items() if agent.curve}
