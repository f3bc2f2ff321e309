# SPDX-License-Identifier: Apache-2.0
"""The Plant: the interface through which agents act on a robot, offline (simulated) or in the live system, and the outcome of an action."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, runtime_checkable

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """The outcome of an action: what the plant measures when the action ends.

    `q`: (n_part,) rad, encoder values of the part's motors.  `settled`: False if the action timed out; agents learn from that outcome too.
    `duration`: s, by the plant's clock.  `touched`: names of the free world objects that touch a link that the part moves, that is, overlap
    one of its solids or fields (volumes that cause repulsive forces).  `perceived`: position (3,) m, root frame, of each object that the
    plant perceives, by name; empty if it perceives none.
    """

    q: Array
    settled: bool
    duration: float
    touched: tuple[str, ...] = ()
    perceived: Mapping[str, Array] = field(default_factory=dict)


class Plant(Protocol):
    """A robot that an agent acts on: offline (simulated in one process) or live (in the system of processes on a message bus)."""

    robot: Robot

    @property
    def q(self) -> Array:
        """The present encoder values of all motors, shape (n,), in [rad], in the order of `robot.motors`."""
        ...

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the motors of the named part, shape (n_part,), in [rad]."""
        ...

    def act(self, part: str, target: Array) -> Outcome:
        """Set the part's attractor to `target` (n_part,) rad and wait until the part has settled, or a time limit is over (thesis 6.1).

        A part is a group of motors, such as an arm; its attractor is the posture to which the controller moves it; it has settled when it
        has come to rest. Raises ActionInterrupted if the action ends without an outcome: by a hold (a safe stop), a fault or a restart of
        the robot.
        """
        ...


@runtime_checkable
class Described(Protocol):
    """A plant that has settings. An agent records them in its store, the file with its transitions.

    Later, an agent can continue in that store only if its plant has the same settings.
    """

    @property
    def settings(self) -> dict[str, Any]:
        """The settings on which the outcomes of actions depend, except the seed, by name, as plain JSON values."""
        ...


@runtime_checkable
class Perceiving(Protocol):
    """A plant that perceives objects and reports their positions."""

    def perceive(self) -> Mapping[str, Array]:
        """Return a dict from the name of each perceived object to its present position (3,) m, root frame."""
        ...


def present_outcome(plant: Plant, part: str) -> Outcome:
    """Return what a plant measures and perceives at present, in the form of an outcome: settled, duration 0, nothing touched.

    `part`: name of the part whose motors are measured.
    """
    return Outcome(plant.measure(part), True, 0.0, perceived=plant.perceive() if isinstance(plant, Perceiving) else {})


class PerceivingPlant:
    """A plant with a function that perceives objects, for agents whose states include the position of an object.

    Args:
        plant: the plant that performs the actions, offline or live.
        perceive: returns the present position (3,) m, root frame, of each perceived object, by name, in a dict, which is empty if none is
            perceived; called at the end of every action.
    """

    def __init__(self, plant: Plant, perceive: Callable[[], Mapping[str, Array]]) -> None:
        self.plant, self.robot, self._perceive = plant, plant.robot, perceive

    @property
    def q(self) -> Array:
        """The present encoder values of all motors, shape (n,), in [rad], in the order of `robot.motors`."""
        return self.plant.q

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the motors of the named part, shape (n_part,), in [rad]."""
        return self.plant.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """Set the part's attractor, wait until the part has settled or a time limit is over, and return the outcome.

        The outcome includes the positions of the objects that are perceived at the end of the action. `target`: (n_part,) rad, the
        attractor, that is, the posture to which the controller moves the part. Raises ActionInterrupted if the action ends without an
        outcome: by a hold (a safe stop), a fault or a restart of the robot.
        """
        return replace(self.plant.act(part, target), perceived=self.perceive())

    def perceive(self) -> Mapping[str, Array]:
        """Return a dict from the name of each perceived object to its present position (3,) m, root frame.

        Raises InvalidValue if the given function returns no dict.
        """
        found = self._perceive()
        if not isinstance(found, Mapping):
            raise InvalidValue(f"perceive returned {found!r}: return a dict from names to positions in m, {{}} if none is perceived.")
        return found

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the plant that performs the actions (`mobee.plant.Described.settings`); empty if it has none."""
        return self.plant.settings if isinstance(self.plant, Described) else {}
