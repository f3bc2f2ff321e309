# SPDX-License-Identifier: Apache-2.0
"""The curious agent: decides, acts through a plant, observes the outcome, and stores every transition (thesis Algorithm 8)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol, cast

from mobee.arrays import Array, checked_count
from mobee.errors import ActionInterrupted, InvalidValue, MobeeError
from mobee.learning.explorers import EXPLORERS, Explorer
from mobee.learning.learner import CuriousLearner, CuriousSettings
from mobee.learning.space import Space
from mobee.plant import Described, Outcome, Plant, present_outcome
from mobee.settings import accepts, imported, named
from mobee.store import Transition, TransitionStore


class CuriousAgent(CuriousLearner):
    """Learns the transition model of a part (motors commanded together) by trying the actions from which it expects to learn most.

    Its decisions depend only on its settings and its transitions. An agent that is restarted with its store therefore continues as if it
    had never stopped. Each transition is stored before the agent learns from it.

    Args:
        space: states and actions of one part.
        plant: the robot on which the agent acts; it must have the motors of the space's robot.
        explorer: how actions are chosen, see `CuriousSettings`; None: as in `settings`.
        seed: seed of the random choice among equally good actions; None: as in `settings`.
        settings: settings of the agent; None: the defaults.
        store: file to which transitions are written, and from which they are read at the start; None: they are not stored.
        continues: file with earlier transitions of the same agent, which are copied to the start of an empty `store`; they may have been
            made on another plant.
        **changes: fields of `CuriousSettings` by keyword, in place of the values in `settings`.

    Raises:
        UnknownName: no such setting, explorer, initialisation, divergence or beliefs.
        InvalidValue: a plant of another robot, a value out of range, a goal that the space does not have, or that the explorer ignores.
        MobeeError: the store holds transitions of this agent that were made with other settings, or on another plant.
    """

    @accepts(CuriousSettings)
    def __init__(
        self,
        space: Space,
        plant: Plant,
        explorer: str | Explorer | None = None,
        seed: int | None = None,
        *,
        settings: CuriousSettings | None = None,
        store: TransitionStore | None = None,
        continues: str | Path | None = None,
        **changes: Any,
    ) -> None:
        changes |= {name: value for name, value in (("explorer", explorer), ("seed", seed)) if value is not None}
        super().__init__(space, CuriousSettings.made(settings, changes))
        if plant.robot.motors != space.robot.motors:
            raise InvalidValue(f"the plant moves {plant.robot.name!r}, the space is of {space.robot.name!r}: make both from one robot.")
        self.plant, self.store = plant, store
        self._state: int | None = None
        self._pending: tuple[int, int] | None = None
        self._is_behind = False  # a write was begun, and what it wrote was not learned
        if continues is not None and store is None:
            raise InvalidValue(f"continues={str(continues)!r} needs a store, to which the transitions are copied: give store=.")
        if store is not None:
            if continues is not None:
                store.continue_from(continues, self.settings)
            store.bind(self.settings)
            self._replay(store.load(), store.explorers())

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the agent and of its space, and those of its plant if the plant has settings, as JSON values."""
        return super().settings | ({"plant": self.plant.settings} if isinstance(self.plant, Described) else {})

    @property
    def state(self) -> int:
        """The present state of the part, according to the last outcome.

        At the start and after an interruption there is no outcome to use; then this property measures the state on the plant.
        """
        if self._state is None:
            before = None if self.last is None else self.last.s_next
            self._state = self.space.state_after(present_outcome(self.plant, self.part), before)
        return self._state

    def decide(self, state: int) -> int:
        """Choose the action to take in a state, and return its number; `target`, `act` and `observe` then refer to this action."""
        if self._is_behind and self.store is not None:
            for transition in self.store.after(self.transitions):
                self._learn(transition)
            self._is_behind = False
        action = self._choose(state)
        self._pending = state, action
        return action

    def explore_by(self, explorer: str | Explorer) -> None:
        """Change the explorer, which chooses the next actions.

        `explorer`: a name, a function, or the text `module:name` of a function, as in `CuriousSettings`. An action that is already decided
        is not changed. The store records the change, so that a restarted agent makes it at the same transition.

        Raises:
            UnknownName: no such explorer.
            InvalidValue: the agent has a goal, which this explorer ignores; or it has a store, and a restarted agent could not import the
                function by its name.
        """
        if self.store is not None and not isinstance(explorer, str):
            name = named("explorer", explorer, EXPLORERS)[0]
            if imported("explorer", name) is not explorer:
                raise InvalidValue(f"explorer {name!r} is another one than the given: with a store, give a function of a module.")
        self._explore_by(explorer)
        if self.store is not None:
            self.store.change_explorer(self.transitions + (self._pending is not None), self.explorer)

    def target(self, action: int) -> Array:
        """Return the pose at which an action aims, shape (n_part,), in [rad].

        `action`: the number that the last call of `decide` returned. Raises MobeeError if no action is under way.
        """
        state, _ = self._decided()
        return self.space.aim(state, action)

    def observe(self, outcome: Outcome) -> float:
        """Learn from the outcome of the action that was decided last; return the reward, the information gain, in nats.

        With a store the transition is on disk when this returns; if it cannot be written, nothing is learned. After an interrupt (Ctrl-C)
        during the write, the next call of `decide` learns the transition if it is on disk. Raises MobeeError if no action is under way.
        """
        state, action = self._decided()
        self._state = None  # unknown if this call is interrupted, or the transition cannot be written
        following = self.space.state_after(outcome, state)
        weigh = self.model.observe if self.store is None else self.model.gain
        transition = Transition(
            n=self.transitions + 1,
            s=state,
            a=action,
            s_next=following,
            reward=weigh(state, action, following),
            settled=outcome.settled,
            duration=outcome.duration,
            q=tuple(outcome.q.tolist()),
            touched=outcome.touched,
        )
        if self.store is None:
            self._continue(transition)
        else:
            self._is_behind = True
            self.store.append(transition)
            self._learn(transition)
            self._is_behind = False
        self._state, self._pending = following, None
        return transition.reward

    def interrupt(self) -> None:
        """Discard the action that was decided last, because it ended without an outcome. The agent learns nothing from it.

        The next read of `state` measures the state again.
        """
        self._state = self._pending = None
        self._plans.undo()

    def step(self) -> float:
        """Decide on an action, perform it and learn from its outcome; return the reward in nats.

        Raises ActionInterrupted if the plant does; then nothing is learned or stored, and the next step measures the state again.
        """
        self.decide(self.state)
        return self.act()

    def act(self) -> float:
        """Perform the action that `decide` chose last, and learn from its outcome; return the reward, the information gain, in nats.

        Raises ActionInterrupted if the plant does: then nothing is learned or stored, and the next read of `state` measures the state
        again, also after any other exception and after Ctrl-C. Raises MobeeError if no action was decided.
        """
        target = self.target(self._decided()[1])
        self._state = None  # unknown until the outcome is observed
        try:
            outcome = self.plant.act(self.part, target)
        except BaseException:  # the robot may have moved
            self.interrupt()
            raise
        return self.observe(outcome)

    def run(self, transitions: int) -> None:
        """Make `transitions` more transitions. An interrupted action does not count: the agent measures its state and decides again.

        Raises InvalidValue unless `transitions` is a whole number of at least 0.
        """
        end = self.transitions + checked_count("transitions", transitions)
        while self.transitions < end:
            try:
                self.step()
            except ActionInterrupted:
                continue

    def _decided(self) -> tuple[int, int]:
        if self._pending is None:
            raise MobeeError(f"the agent of {self.part} has no action under way: call decide(state) first.")
        return self._pending


class ConcurrentPlant(Plant, Protocol):
    """A plant that can perform actions of several parts at the same time."""

    def begin(self, part: str, target: Array) -> None:
        """Start an action of a part, without waiting for its end. `target`: (n_part,) rad, the pose at which the action aims."""

    def advance(self) -> list[tuple[str, Outcome]]:
        """Run the plant until at least one action has ended; return (part, outcome) of each action that has ended."""


def run(agents: Sequence[CuriousAgent], transitions: int) -> None:
    """Run agents of different parts at the same time on one plant until they have made `transitions` more transitions in total.

    Exactly that many actions are started, so at the end all actions have ended and every transition was observed. Raises InvalidValue
    unless each agent has its own part, all have the same plant, a `ConcurrentPlant`, and `transitions` is a whole number of at least 0.
    After an exception or Ctrl-C the actions under way are not learned, and each agent measures its state.
    """
    plant, transitions = _common_plant(agents), checked_count("transitions", transitions)
    try:
        _run_together(plant, agents, transitions)
    except BaseException:  # the robot may have moved
        for agent in agents:
            agent.interrupt()
        raise


def _run_together(plant: ConcurrentPlant, agents: Sequence[CuriousAgent], transitions: int) -> None:
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
        raise InvalidValue(f"several agents move {shared[0]}: valid is one agent per part.")
    if not (hasattr(plant, "begin") and hasattr(plant, "advance")):
        raise InvalidValue(f"{type(plant).__name__} has no begin and advance: run each agent with agent.run in a process of its own.")
    return cast(ConcurrentPlant, plant)
