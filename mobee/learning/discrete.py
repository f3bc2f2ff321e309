# SPDX-License-Identifier: Apache-2.0
"""Discrete decision problems: a space of numbered states and actions, and the base of plants that perform an action at once.

The space is for problems without a robot. The plants have one part, and simulate no motion.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.space import MAX_STATES, Space
from mobee.plant import Outcome
from mobee.robot.robot import Motor, Part, Robot

MOTORS = ("state", "action")
"""The motors of the robot that stands for a decision problem. Their positions are numbers of a state and of an action, not angles."""


class DiscreteSpace(Space):
    """Numbered states, each with the same numbered actions, of a decision problem without a robot.

    It is the Space of a robot with two motors, "state" and "action". The position of the first is the number of the state, the position of
    the second the number of the action. So agents and plants of this library work with it. Before the first try of an action, a transition
    model contains imagined outcomes: the action leaves the state unchanged, or reaches its goal. Without `goals`, the goal of an action is
    the state in which it starts, so no imagined outcome is another state. Then give the agent the setting `beliefs="debiased"`, with which
    the imagined outcomes have little weight in its plans.

    Args:
        states: number of states, at least 2.
        actions: number of actions of each state, at least 1.
        goals: (S, A) the state to which each action is expected to lead; None: not known; the goal of each action is then the state in
            which it starts.
        name: name of the robot and of its only part.

    Raises:
        InvalidValue: an argument is out of its range; the message states the valid one.
    """

    only_postures = False

    def __init__(self, states: int, actions: int, goals: ArrayLike | None = None, name: str = "environment") -> None:
        if not 2 <= states <= MAX_STATES or actions < 1:
            raise InvalidValue(f"{states} states and {actions} actions: give 2 to {MAX_STATES} states, and 1 or more actions.")
        expected = np.tile(np.arange(states)[:, None], (1, actions)) if goals is None else real_array("goals", goals)
        if expected.shape != (states, actions) or expected.min() < 0:
            raise InvalidValue(f"goals of shape {expected.shape}: give a state for each state and action, shape {(states, actions)}.")
        super().__init__(_robot(states, actions, name), MOTORS[:1], np.arange(float(states))[:, None], expected, rest=0.0)

    def __repr__(self) -> str:
        return f"<DiscreteSpace of {self.part}: {len(self)} states, {self.state_actions} state-actions>"

    def aim(self, state: int, action: int) -> Array:
        """Return the target of an action for a plant, shape (2,): the number of the expected state, and the number of the action."""
        return np.array([self.goal(state, action), action], dtype=np.float64)

    def action_of(self, target: Array) -> int:
        """Return the number of the action from a target (2,) that `aim` returned.

        Raises InvalidValue for another shape, or if there is no such action; the state in the target is not checked.
        """
        actions = self.goals.shape[1]
        if np.shape(target) != (2,) or target[1] not in range(actions):
            raise InvalidValue(f"target {target!r} of {self.part}: give the state that is expected and an action from 0 to {actions - 1}.")
        return int(target[1])

    @property
    def settings(self) -> dict[str, Any]:
        """The numbers of states and actions, and a hash of the space, as JSON values."""
        return self._made | {"kind": "discrete", "states": len(self), "actions": self.goals.shape[1]}

    def _cell(self, q: list[float]) -> int:
        return min(max(round(q[0]), 0), len(self) - 1)


class InstantPlant(ABC):
    """A plant of one part that simulates no motion: an action ends in the call of `act`, and counts as 1 s.

    `begin` only stores the target; `advance` then calls `act`. So `mobee.learning.agent.run` can use the plant too.
    """

    def __init__(self, space: Space) -> None:
        self.space: Space = space
        """The states and actions of the part."""
        self.robot = space.robot
        self._under_way: Array | None = None

    @abstractmethod
    def act(self, part: str, target: Array) -> Outcome:
        """Perform an action and return its outcome; the action counts as 1 s.

        `part`: must be `space.part`, where `space` is the plant's state space. `target`: (n_part,), as the method `space.aim` returns it
        for a state and an action.
        """

    def begin(self, part: str, target: Array) -> None:
        """Store the target of an action; `advance` performs the action. Raises InvalidValue if an action is under way.

        `part`: must be `space.part`, else UnknownName is raised. `target`: as in `act`.
        """
        self._check_part(part)
        if self._under_way is not None:
            raise InvalidValue(f"{part} has an action under way: wait for it with advance().")
        self._under_way = target

    def advance(self) -> list[tuple[str, Outcome]]:
        """Perform the action that was begun; return a list with its part and outcome. Raises InvalidValue if none was begun."""
        if self._under_way is None:
            raise InvalidValue("no action is under way: begin one first.")
        target, self._under_way = self._under_way, None
        return [(self.space.part, self.act(self.space.part, target))]

    def _check_part(self, part: str) -> None:
        if part != self.space.part:
            raise UnknownName("part", part, (self.space.part,))


def _robot(states: int, actions: int, name: str) -> Robot:
    """Return a robot of two motors without joints and shapes, whose positions are the number of a state and of an action."""
    sizes = (states, max(actions, 2))
    motors = tuple(Motor(motor, name, np.array([0.0, size - 1.0]), 0.0, ()) for motor, size in zip(MOTORS, sizes, strict=True))
    none = np.empty((0, 2), dtype=np.intp)
    return Robot(name, ("base",), (), motors, {name: Part(name, MOTORS, 0)}, {}, (), (), none, none)
