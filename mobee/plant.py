"""The Plant: the interface through which agents act, offline and live."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from mobee.arrays import Array
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """How an action ended.

    `q`: (n_part,) rad as the encoders say.  `settled`: False means timeout, still an observation.
    `duration`: s of plant time.  `touched`: names of world objects in contact (fields included) at the end.
    """

    q: Array
    settled: bool
    duration: float
    touched: tuple[str, ...] = ()


class Plant(Protocol):
    """A robot one can act on (DESIGN section 2)."""

    robot: Robot

    def measure(self, part: str) -> Array:
        """The part's motor positions as the encoders say now, shape (n_part,), in [rad]."""
        ...

    def act(self, part: str, target: Array) -> Outcome:
        """Set the part's attractor and wait until it settles or times out (thesis 6.1).

        `target`: (n_part,) rad, all motors of the part.  Raises ActionInterrupted on hold, fault or a new run.
        """
        ...


@runtime_checkable
class Described(Protocol):
    """A plant that tells what it is; an agent keeps that with its record, and goes on only on such a plant."""

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides how actions end, but for chance, as plain JSON values."""
        ...
