# SPDX-License-Identifier: Apache-2.0
"""A plant that passes all calls to another plant: the base class of plants that observe or falsify what an agent does."""

from __future__ import annotations

from typing import Generic, TypeVar

from mobee.arrays import Array
from mobee.plant import Outcome
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget

P = TypeVar("P", bound=ReachPlant)


class WrappedPlant(Generic[P]):
    """A `mobee.reach.ReachPlant` that passes every call to the plant `inner`; a subclass changes some of the methods."""

    def __init__(self, inner: P) -> None:
        self.inner, self.robot = inner, inner.robot

    @property
    def q(self) -> Array:
        """The present encoder values of all motors of the inner plant, (n,) rad, in the order of `robot.motors`."""
        return self.inner.q

    def measure(self, part: str) -> Array:
        """Return the present encoder values of the part's motors, (n_part,) rad, from the inner plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """Perform the action on the inner plant: set the attractor to `target` (n_part,) rad and wait, as in `mobee.plant.Plant.act`."""
        return self.inner.act(part, target)

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world of the inner plant, or move it there; None removes it, as in `mobee.reach.ReachPlant.present`."""
        self.inner.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Perform the reach on the inner plant: pull the marker to the presented target, as in `mobee.reach.ReachPlant.reach`.

        `stay`: the part stays where the reach ended; otherwise its attractor pulls it back.
        """
        return self.inner.reach(part, marker, stay)
