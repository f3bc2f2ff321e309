# SPDX-License-Identifier: Apache-2.0
"""Publishes the transitions of an agent, and the rewards and values of its state-actions."""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import numpy as np

from bus_schema.messages import Decision, Learned, Surprise
from bus_schema.messages import Transition as TransitionMessage
from mobee import CuriousAgent, ReachTarget, TransitionModel
from mobee.arrays import Array
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.reaches import REACH
from mobee.learning.reaching.store import Step
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel, probability_of
from mobee.store import Transition
from services.common.bus import Bus, Publisher

PERIOD = 0.5  # s of wall-clock time between two `Learned` messages: in lockstep, transitions come faster than a viewer needs them
MAX_SURPRISES = 2000  # in one message
LONGEST_PLAN = 12  # states of a plan that are published


def publish_transition(
    stream: Publisher[TransitionMessage], space: Space, n: int, made: Transition | Step, value: float, probability: float
) -> None:
    """Publish a transition, the n-th of its agent.

    `space`: the state space of the agent. `value`: V(s), the value of the state before the action, by the plan that chose the action.
    `probability`: probability of the observed next state by the agent's model before the action. `made`: the transition.
    """
    stream.put(
        agent=space.part,
        n=n,
        s=made.s,
        a=made.a,
        goal=int(space.goal(made.s, made.a)),
        s_next=made.s_next,
        reward=made.reward,
        value=value,
        probability=probability,
        settled=made.settled,
        duration=made.duration,
        touched=list(made.touched),
    )


def publish_decision(stream: Publisher[Decision], agent: CuriousAgent, state: int, action: int) -> None:
    """Publish that an agent begins `action` (its number) in `state`, with what the agent expects from the action."""
    beliefs, goal = agent.beliefs, int(agent.space.goal(state, action))
    expected, probability = _likeliest(beliefs, state, action)
    stream.put(
        agent=agent.part,
        n=agent.transitions,
        s=state,
        a=action,
        goal=goal,
        tries=int(agent.model.tries[state, action]),
        reached=probability_of(beliefs, state, action, goal),
        expected=expected,
        probability=probability,
        reward=float(agent.model.reward[state, action]),
        explorer=agent.explorer,
        plan=planned_states(agent, expected),
    )


def planned_states(agent: CuriousAgent, state: int) -> list[int]:
    """Return the sequence of states that an agent expects if it follows its plan from `state`.

    The first element is `state`. The last one is the state in which the agent expects the largest reward, among the first LONGEST_PLAN (12)
    states of the plan.
    """
    action_values, reward = agent.plan()[1], agent.model.reward
    passed, rewards = [state], []
    while len(passed) <= LONGEST_PLAN:
        action = int(action_values[passed[-1]].argmax())
        rewards.append(float(reward[passed[-1], action]))
        passed.append(_likeliest(agent.beliefs, passed[-1], action)[0])
    return passed[: int(np.argmax(rewards)) + 1]


def _likeliest(beliefs: OutcomeModel, s: int, a: int) -> tuple[int, float]:
    """Return the most probable outcome of a state-action and its probability; among equally probable ones, the newest."""
    probabilities = beliefs.probabilities[s, a]
    best = len(probabilities) - 1 - int(probabilities[::-1].argmax())
    return int(beliefs.outcomes[s, a, best]), float(probabilities[best])


class LearnedStream:
    """Publishes a `Learned` message (counts, rewards and values of all actions) after a transition, at most every 0.5 s of real time."""

    def __init__(self, bus: Bus, model: TransitionModel) -> None:
        """`model`: the transition model of the agent."""
        self._model, self._part = model, model.space.part
        self._space = json.dumps(model.space.settings)
        self._stream = bus.publisher(Learned, self._part)
        self._next = -np.inf  # s, monotonic clock

    def put(self, n: int, s: int, numbers: Callable[[], tuple[Array, Array]]) -> None:
        """Publish a `Learned` message if the last one is at least 0.5 s old.

        `n`: number of transitions that the agent has observed. `s`: its present state. `numbers`: called only for a message that is
        published; returns rewards and values of all state-actions, (S, A) each: S states with at most A actions each.
        """
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + PERIOD
        reward, value = numbers()
        self._stream.put(
            agent=self._part,
            n=n,
            s=s,
            space=self._space,
            tries=self._model.tries.astype("<u4").tobytes(),
            reward=reward.astype("<f4").tobytes(),
            value=value.astype("<f4").tobytes(),
            surprises=surprises(self._model),
        )


def surprises(model: TransitionModel) -> list[Surprise]:
    """Return the observed next states that differ from the goals of their actions, each with its share of the action's observations.

    Only real observations are used, without the pseudo-counts that each action has before its first try. At most MAX_SURPRISES (2000)
    outcomes are returned, those with the largest shares.
    """
    real = np.where(model.counts > 0.0, model.counts - model.imagined, 0.0)
    unexpected = (real > 0.0) & (model.outcomes != model.space.goals[:, :, None])
    share = real / np.maximum(real.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    found = np.argwhere(unexpected)
    if len(found) > MAX_SURPRISES:
        found = found[np.sort(np.argsort(-share[unexpected], kind="stable")[:MAX_SURPRISES])]
    return [Surprise(int(s), int(a), int(model.outcomes[s, a, b]), float(share[s, a, b])) for s, a, b in found]


class ReachStream:
    """Publishes the transitions of an agent that learns to reach, and `Learned` messages (counts of transitions, rewards and values).

    The reaches are not published here: the controller publishes a `Reach` message for each.
    """

    def __init__(self, bus: Bus, agent: ReachAgent) -> None:
        self._agent, self._seen, self._count = agent, TransitionModel(agent.space), 0
        for step in agent.store.load() if agent.store is not None else []:
            self._note(step)
        self._transitions = bus.publisher(TransitionMessage, agent.part)
        self._learned = LearnedStream(bus, self._seen)

    def put(self, step: Step, target: ReachTarget, plan: tuple[Array, Array]) -> None:
        """Publish a step of the agent towards the target `target`, and add its transition to the counts.

        `plan`: values V (S,) and Q (S, A + 1) of the plan that chose the step, for S states with at most A actions each; the last column of
        Q is the action of reaching. A step that is a reach is not a transition, and is not published as one.
        """
        values, action_values = plan
        believed = probability_of(self._seen, step.s, step.a, step.s_next) if step.a != REACH else 0.0
        self._note(step)
        if step.a != REACH:
            publish_transition(self._transitions, self._agent.space, self._count, step, float(values[step.s]), believed)

        def numbers() -> tuple[Array, Array]:
            value, best = action_values[:, :-1], float(action_values[:, -1].max())
            return np.where(np.isneginf(value), value, self._agent.failures.rewards(target.position, best)), value

        self._learned.put(self._count, step.s_next, numbers)

    def _note(self, step: Step) -> None:
        if step.a != REACH:
            self._seen.observe(step.s, step.a, step.s_next)
            self._count += 1
