# SPDX-License-Identifier: Apache-2.0
"""The Plant: the interface through which agents act, offline and live."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

from mobee.arrays import Array
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """How an action ended.

    `q`: (n_part,) rad, as the encoders measure it.  `settled`: False if the action timed out; agents learn from that outcome too.
    `duration`: s, by the plant's clock.  `touched`: names of world objects in contact (fields included) at the end.
    `perceived`: places (3,) m of the objects that the plant perceives at the end, by name, in the root frame.
    """

    q: Array
    settled: bool
    duration: float
    touched: tuple[str, ...] = ()
    perceived: Mapping[str, Array] = field(default_factory=dict)


class Plant(Protocol):
    """A robot that an agent acts on, offline or live."""

    robot: Robot

    @property
    def q(self) -> Array:
        """The present encoder values of all motors, shape (n,), in [rad], in the order of `robot.motors`."""
        ...

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the part's motors, shape (n_part,), in [rad]."""
        ...

    def act(self, part: str, target: Array) -> Outcome:
        """Set the part's attractor and wait until it settles or times out (thesis 6.1).

        `target`: (n_part,) rad, all motors of the part.  Raises ActionInterrupted on hold, fault or a new run.
        """
        ...


@runtime_checkable
class Described(Protocol):
    """A plant with settings that can be recorded; an agent continues a record only on a plant of equal settings."""

    @property
    def settings(self) -> dict[str, Any]:
        """Settings that determine how actions end, without the seed, as plain JSON values."""
        ...


@runtime_checkable
class Perceiving(Protocol):
    """A plant that perceives objects."""

    def perceive(self) -> Mapping[str, Array]:
        """Return the present places (3,) m of the objects that are perceived, by name, in the root frame."""
        ...


def present_outcome(plant: Plant, part: str) -> Outcome:
    """Return what a plant measures and perceives at present, as the outcome of an action that has just ended."""
    return Outcome(plant.measure(part), True, 0.0, perceived=plant.perceive() if isinstance(plant, Perceiving) else {})


class PerceivingPlant:
    """A plant that also perceives objects, by a function: for agents whose states hold where an object is.

    Args:
        plant: on which the actions are performed, offline or live.
        perceive: returns the present places (3,) m of the objects that are perceived, by name; called at the end of every action.
    """

    def __init__(self, plant: Plant, perceive: Callable[[], Mapping[str, Array]]) -> None:
        self.plant, self.robot, self._perceive = plant, plant.robot, perceive

    @property
    def q(self) -> Array:
        """See Plant."""
        return self.plant.q

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self.plant.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant; the outcome holds what is perceived at the end."""
        return replace(self.plant.act(part, target), perceived=self.perceive())

    def perceive(self) -> Mapping[str, Array]:
        """See Perceiving."""
        return self._perceive()

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the plant, if it has any; see Described."""
        return self.plant.settings if isinstance(self.plant, Described) else {}
