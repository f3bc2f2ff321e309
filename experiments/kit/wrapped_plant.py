# SPDX-License-Identifier: Apache-2.0
"""A plant around another one, the base of those that observe or falsify what an agent does."""

from __future__ import annotations

from typing import Generic, TypeVar

from mobee.arrays import Array
from mobee.plant import Outcome
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget

P = TypeVar("P", bound=ReachPlant)


class WrappedPlant(Generic[P]):
    """A ReachPlant that does everything on its `inner` plant; a subclass changes some of the methods."""

    def __init__(self, inner: P) -> None:
        self.inner, self.robot = inner, inner.robot

    @property
    def q(self) -> Array:
        """See Plant."""
        return self.inner.q

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        return self.inner.act(part, target)

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        self.inner.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """See ReachPlant."""
        return self.inner.reach(part, marker, stay)
