"""An offline plant whose tries are judged by where things truly are, which its encoders and eyes may have wrong."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mobee import OfflinePlant
from mobee.errors import InvalidValue
from mobee.plant import Outcome
from mobee.reach import ReachOutcome, ReachTarget
from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True, eq=False)
class Errors:
    """By how much the motors truly stand elsewhere than the encoders say, (n,) rad, and targets than they are seen, (3,) m."""

    turns: Array
    shift: Array


class JudgedPlant:
    """What moves, what is felt and what pulls follows encoders and eyes; what a reach missed is said of where things truly are.

    Args:
        plant: which is driven.
        errors: of its encoders and eyes.
        unseen: names of world objects that nobody is told of.
    """

    def __init__(self, plant: OfflinePlant, errors: Errors | None = None, unseen: Collection[str] = ()) -> None:
        self.inner, self.robot, self.model = plant, plant.robot, plant.model
        n = len(plant.robot.motors)
        self.errors = Errors(np.zeros(n), np.zeros(3)) if errors is None else errors
        self._unseen = frozenset(unseen)
        self._target: ReachTarget | None = None

    @property
    def time(self) -> float:
        """Plant time in s."""
        return self.inner.time

    @property
    def settings(self) -> dict[str, Any]:
        """See Described."""
        errors = {"turns": self.errors.turns.tolist(), "shift": self.errors.shift.tolist()}
        return self.inner.settings | {"errors": errors, "unseen": sorted(self._unseen)}

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        return self._told(self.inner.act(part, target))

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """As `act`, but the marker's hand does not feel the target, as in a reach: who sends it there has planned around it."""
        self.model.reaching = marker
        try:
            return self.act(part, target)
        finally:
            self.model.reaching = None

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant; the target where it is seen."""
        self._target = target
        self.inner.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """See ReachPlant; with where the marker truly was at the end of the force, and what it truly missed."""
        found = self.inner.reach(part, marker, stay)
        where = self.marker_at(marker, part, found.q)
        return replace(
            found, marker=where, missing=self._true.missing(where), touched=self._seen(found.touched), after=self._told(found.after)
        )

    def missing(self, marker: str) -> float:
        """How far the marker truly is from where the target truly is, now; m."""
        return self._true.missing(self.marker_at(marker))

    def marker_at(self, marker: str, part: str | None = None, q: Array | None = None) -> Array:
        """Where the marker truly is, (3,) m: now, or with the part's motors at q (n_part,) rad by their encoders."""
        whole = np.concatenate([self.inner.measure(name) for name in self.robot.parts])
        if part is not None and q is not None:
            whole[self.robot.part(part).slice] = q
        found: Array = self.model.evaluate(whole + self.errors.turns).position(marker)
        return found

    @property
    def _true(self) -> ReachTarget:
        if self._target is None:
            raise InvalidValue("no target is presented; call present(ReachTarget(position)) first")
        return replace(self._target, position=self._target.position + self.errors.shift)

    def _told(self, outcome: Outcome) -> Outcome:
        return replace(outcome, touched=self._seen(outcome.touched))

    def _seen(self, touched: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(name for name in touched if name not in self._unseen)
