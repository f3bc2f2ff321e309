# SPDX-License-Identifier: Apache-2.0
"""The Plant: the interface through which agents act, offline and live."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from mobee.arrays import Array
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """How an action ended.

    `q`: (n_part,) rad, as the encoders measure it.  `settled`: False if the action timed out; agents learn from that outcome too.
    `duration`: s, by the plant's clock.  `touched`: names of world objects in contact (fields included) at the end.
    """

    q: Array
    settled: bool
    duration: float
    touched: tuple[str, ...] = ()


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
