"""Poses to be judged: which motors may move, and what the terms say of batches of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue, UnknownName
from mobee.model import Model
from mobee.pose import Pose
from mobee.real_array import real_array
from mobee.roadmap.ik.costs import term
from mobee.roadmap.ik.solids import solid_model
from mobee.roadmap.ik.term import Term
from mobee.robot.robot import Array, Ints, Robot

Cost = Term | Callable[[Pose, Any], ArrayLike]


class Problem:
    """The terms of a cost over some motors, the others as at the start; counts how many poses were evaluated."""

    def __init__(
        self, model: Model, costs: Sequence[Cost], start: ArrayLike | None, motors: Sequence[str] | None, margin: float = 0.0
    ) -> None:
        robot = model.robot
        self.model = solid_model(model)
        self.by_name = named([cost if isinstance(cost, Term) else term(cost) for cost in costs])
        self.terms = tuple(self.by_name.values())
        if not self.terms:
            raise InvalidValue("costs are empty: give terms of mobee.costs, or functions of pose and contacts.")
        self.free = chosen(robot, motors)
        self.limits = _within(robot.limits[self.free], margin)
        self.start = _start(model, start)
        self.start[self.free] = np.clip(self.start[self.free], *self.limits.T)
        self.must = any(one.tolerance is not None for one in self.terms)
        self.evaluations = 0

    def whole(self, samples: Array) -> Array:
        """All motors (N, n) from the free ones (N, d)."""
        q = np.repeat(self.start[None], len(samples), axis=0)
        q[:, self.free] = samples
        return q

    def look(self, q: Array) -> tuple[Array, Array]:
        """The cost of poses q (N, n), (N,), and which of them are within all tolerances, (N,) bool."""
        pose = self.model.evaluate(q)
        self.evaluations += len(q)
        total, good = np.zeros(len(q)), np.ones(len(q), dtype=bool)
        for one in self.terms:
            missing = one.residual(pose)
            total += one.weight * missing
            if one.tolerance is not None:
                good &= missing <= one.tolerance
        return total, good


def _within(limits: Array, margin: float) -> Array:
    """The limits (d, 2) less a margin at both ends, but no more than a quarter of a range."""
    if not (np.isfinite(margin) and margin >= 0.0):
        raise InvalidValue(f"margin {margin!r} rad: must be finite and at least 0.")
    kept = np.minimum(margin, 0.25 * (limits[:, 1] - limits[:, 0]))
    return np.stack([limits[:, 0] + kept, limits[:, 1] - kept], axis=1)


def chosen(robot: Robot, motors: Sequence[str] | None) -> Ints:
    """Indices of the motors that may move, (d,), of their names or those of parts; None: all."""
    if motors is None:
        return np.arange(len(robot.motors))
    if isinstance(motors, str):
        raise InvalidValue(f"motors is {motors!r}; it must be a list of names, as [{motors!r}].")
    found: set[int] = set()
    for name in motors:
        if name in robot.parts:
            where = robot.parts[name].slice
            found.update(range(where.start, where.stop))
        elif name in robot.motors:
            found.add(robot.motor_index(name))
        else:
            raise UnknownName("part or motor", name, [*robot.parts, *robot.motors])
    if not found:
        raise InvalidValue("motors is empty: name parts or motors, or leave it None for all.")
    return np.array(sorted(found))


def named(terms: Sequence[Term]) -> dict[str, Term]:
    """The terms by name; of equal names the later ones get a number."""
    found: dict[str, Term] = {}
    for one in terms:
        name, number = one.name, 1
        while name in found:
            number += 1
            name = f"{one.name} {number}"
        found[name] = one
    return found


def _start(model: Model, start: ArrayLike | None) -> Array:
    if start is None:
        return model.robot.home.copy()
    q = real_array("start", start)
    if q.shape != (len(model.robot.motors),) or not np.isfinite(q).all():
        raise InvalidValue(f"start has shape {q.shape}; it must be ({len(model.robot.motors)},) rad, finite, a position for every motor.")
    return q
