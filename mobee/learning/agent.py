"""The curious agent: decides, acts through a plant, observes, forgets nothing (thesis Algorithm 8)."""

from __future__ import annotations

import zlib
from typing import Any

import numpy as np

from mobee.errors import ActionInterrupted, InvalidValue, MobeeError, UnknownName
from mobee.learning.explorers import EXPLORERS, choose
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import value_iteration
from mobee.plant import Outcome, Plant
from mobee.robot.robot import Array
from mobee.store import Transition, TransitionStore


class CuriousAgent:
    """Learns the transition model of one part by trying what it expects to learn most from.

    Everything it decides follows from its settings and the transitions so far, so an agent that is started again on
    its store goes on as if it had never stopped.  The store is written before the agent learns from a transition.

    Args:
        space: states and actions of one part.
        plant: through which it acts; its robot must be the space's.
        explorer: "curious", "random" or "least_tried".
        seed: decides ties; agents of different parts draw differently under the same seed.
        discount: of future rewards in the plan.
        initial: what actions are imagined to do before they are tried, "50-50" or "60-40".
        store: where transitions go and come from.

    Raises:
        UnknownName: no such explorer or initialisation.
        MobeeError: the store holds transitions of this agent that were made under other settings.
    """

    def __init__(
        self,
        space: Space,
        plant: Plant,
        explorer: str = "curious",
        seed: int = 0,
        discount: float = 0.9,
        initial: str = "50-50",
        store: TransitionStore | None = None,
    ) -> None:
        if explorer not in EXPLORERS:
            raise UnknownName("explorer", explorer, EXPLORERS)
        if plant.robot.motors != space.robot.motors:
            raise InvalidValue(f"the plant moves {plant.robot.name!r}, the space is of {space.robot.name!r}: make both from one robot.")
        self.space, self.plant, self.explorer = space, plant, explorer
        self.seed, self.discount, self.store = seed, discount, store
        self.part = space.part
        self.model = TransitionModel(space, initial)
        self.transitions = 0
        """How many transitions this agent has observed, those of its store included."""
        self.last: Transition | None = None
        """The newest transition."""
        self._state: int | None = None
        self._pending: tuple[int, int] | None = None
        self._plan: tuple[Array, Array] | None = None
        if store is not None:
            store.bind(self.settings)
            for transition in store.load():
                self._learn(transition)

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides what the agent does, as plain JSON values."""
        return {
            "space": self.space.settings,
            "explorer": self.explorer,
            "seed": self.seed,
            "discount": self.discount,
            "initial": self.model.initial,
        }

    @property
    def state(self) -> int:
        """Where the part is: measured at first and after an interruption, else from the last outcome."""
        if self._state is None:
            self._state = self._state_of(self.plant.measure(self.part))
        return self._state

    def plan(self) -> tuple[Array, Array]:
        """State and action values under the intrinsic reward, shapes (S,) and (S, A): once a transition (Algorithm 7)."""
        if self._plan is None:
            self._plan = value_iteration(self.model, self.model.reward, self.discount)
        return self._plan

    def decide(self, state: int) -> int:
        """The action to take in a state."""
        rng = np.random.default_rng([self.seed, zlib.crc32(self.part.encode()), self.transitions])
        scores = EXPLORERS[self.explorer](self, state, rng)
        action = choose(scores, rng)
        self._pending = state, action
        return action

    def target(self, action: int) -> Array:
        """The pose of the part at which the action just decided aims, shape (n_part,), in [rad]."""
        state, _ = self._decided()
        return self.space.target(self.space.goal(state, action))

    def observe(self, outcome: Outcome) -> float:
        """Learn from how the action just decided ended; returns the reward in nats.

        With a store the transition is on disk when this returns; if it cannot be written nothing is learnt.
        """
        state, action = self._decided()
        following = self._state_of(outcome.q)
        transition = Transition(
            n=self.transitions + 1,
            s=state,
            a=action,
            s_next=following,
            reward=self.model.gain(state, action, following),
            settled=outcome.settled,
            duration=outcome.duration,
            q=tuple(float(x) for x in outcome.q),
            touched=outcome.touched,
        )
        if self.store is not None:
            self.store.append(transition)
        self._learn(transition)
        self._state, self._pending = following, None
        return transition.reward

    def interrupt(self) -> None:
        """Forget the action just decided: it ended without an outcome, and where the part is must be measured again."""
        self._state = self._pending = None

    def step(self) -> float:
        """Decide, act and observe once; returns the reward in nats.

        Raises ActionInterrupted if the plant does; nothing is stored then and the next step measures again.
        """
        action = self.decide(self.state)
        try:
            outcome = self.plant.act(self.part, self.target(action))
        except ActionInterrupted:
            self.interrupt()
            raise
        return self.observe(outcome)

    def run(self, transitions: int) -> None:
        """Observe that many more transitions; an interrupted action does not count and is decided anew."""
        end = self.transitions + transitions
        while self.transitions < end:
            try:
                self.step()
            except ActionInterrupted:
                continue

    def _learn(self, transition: Transition) -> None:
        self.model.observe(transition.s, transition.a, transition.s_next)
        self.transitions, self.last, self._plan = transition.n, transition, None

    def _decided(self) -> tuple[int, int]:
        if self._pending is None:
            raise MobeeError(f"the agent of {self.part} has no action under way: call decide(state) first.")
        return self._pending

    def _state_of(self, q: Array) -> int:
        return self.space.state_of(q[self.space.columns])
