"""The curious agent: decides, acts through a plant, observes, stores every transition (thesis Algorithm 8)."""

from __future__ import annotations

from typing import Any

from mobee.arrays import Array
from mobee.errors import ActionInterrupted, InvalidValue, MobeeError
from mobee.learning.decider import Decider
from mobee.learning.explorers import Explorer
from mobee.learning.goal import Goal
from mobee.learning.space import Space
from mobee.plant import Described, Outcome, Plant
from mobee.store import Transition, TransitionStore


class CuriousAgent(Decider):
    """Learns the transition model of one part by trying what it expects to learn most from.

    Everything it decides follows from its settings and the transitions so far, so an agent that is started again on
    its store goes on as if it had never stopped.  The store is written before the agent learns from a transition.

    Args:
        space: states and actions of one part.
        plant: through which it acts; its robot must be the space's.
        explorer: a name in `mobee.learning.explorers.EXPLORERS`, "curious", "random", "least_tried", ...; or your own, see `Explorer`:
            a function, or `module:name` of one that can be imported.
        seed: decides ties; agents of different parts draw differently under the same seed.
        discount: of future rewards in the plan.
        initial: what actions are imagined to do before they are tried, "50-50" or "60-40".
        store: where transitions go and come from.
        divergence: what an outcome is worth, "kail" or "kl".
        forgetting: factor of a state-action's counts before each new observation of it, in (0, 1].
        tolerance: of plans, see `value_iteration`.
        relative: whether the tolerance is in units of the largest reward (the rewards fall below any fixed one), and a plan
            starts from the values of the one before.  False, with tolerance=1e-3: Algorithm 7 as published.
        beliefs: what plans trust, "counts" with the imagined outcomes, or "debiased" without them.
        goal: an external reward to pursue: target states, an array (S, A), or a function of state, action and goal state.
        goal_weight: the external reward times this is added to the intrinsic one; None: it replaces it.

    Raises:
        UnknownName: no such explorer, initialisation, divergence or beliefs.
        InvalidValue: a plant of another robot, a goal that the space does not have, or that the explorer ignores.
        MobeeError: the store holds transitions of this agent that were made under other settings, or through another plant.
    """

    def __init__(
        self,
        space: Space,
        plant: Plant,
        explorer: str | Explorer = "curious",
        seed: int = 0,
        discount: float = 0.9,
        initial: str = "50-50",
        store: TransitionStore | None = None,
        *,
        divergence: str = "kail",
        forgetting: float = 1.0,
        tolerance: float = 0.01,
        relative: bool = True,
        beliefs: str = "counts",
        goal: Goal | None = None,
        goal_weight: float | None = None,
    ) -> None:
        super().__init__(space, explorer, seed, discount, initial, divergence, forgetting, tolerance, relative, beliefs, goal, goal_weight)
        if plant.robot.motors != space.robot.motors:
            raise InvalidValue(f"the plant moves {plant.robot.name!r}, the space is of {space.robot.name!r}: make both from one robot.")
        self.plant, self.store = plant, store
        self._state: int | None = None
        self._pending: tuple[int, int] | None = None
        if store is not None:
            store.bind(self.settings)
            self._replay(store.load())

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides what the agent does, as plain JSON values; the plant's too, where it can tell them."""
        return super().settings | ({"plant": self.plant.settings} if isinstance(self.plant, Described) else {})

    @property
    def state(self) -> int:
        """Where the part is: measured at first and after an interruption, else from the last outcome."""
        if self._state is None:
            self._state = self.space.state_of_part(self.plant.measure(self.part).tolist())
        return self._state

    def decide(self, state: int) -> int:
        """The action to take in a state."""
        action = self._choose(state)
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
        q = outcome.q.tolist()
        following = self.space.state_of_part(q)
        weigh = self.model.observe if self.store is None else self.model.gain
        transition = Transition(
            n=self.transitions + 1,
            s=state,
            a=action,
            s_next=following,
            reward=weigh(state, action, following),
            settled=outcome.settled,
            duration=outcome.duration,
            q=tuple(q),
            touched=outcome.touched,
        )
        if self.store is None:
            self._go_on(transition)
        else:
            self.store.append(transition)
            self._learn(transition)
        self._state, self._pending = following, None
        return transition.reward

    def interrupt(self) -> None:
        """Forget the action just decided: it ended without an outcome, and where the part is must be measured again."""
        self._state = self._pending = None
        self._plans.undo()

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

    def _decided(self) -> tuple[int, int]:
        if self._pending is None:
            raise MobeeError(f"the agent of {self.part} has no action under way: call decide(state) first.")
        return self._pending
