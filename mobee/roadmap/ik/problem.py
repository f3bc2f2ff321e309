# SPDX-License-Identifier: Apache-2.0
"""The pose search problem: the motors that move, the motors that are sampled, and the costs of batches of poses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array, Ints, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.roadmap.ik.costs import term
from mobee.roadmap.ik.terms import MOTOR, Aim, Term
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Robot, per_robot

_KNOWN: WeakKeyDictionary[Model, Model] = WeakKeyDictionary()


def solid_model(model: Model) -> Model:
    """Return a model of the same world whose robot has only its solid shapes.

    The fields, which are larger shapes that cause repulsive forces, are left out. The result is cached for each model.
    """
    known = _KNOWN.get(model)
    if known is None:
        known = _KNOWN[model] = Model(solid_robot(model.robot), model.world)
    return known


@per_robot
def solid_robot(robot: Robot) -> Robot:
    """Return a copy of the robot with only its solid shapes; the fields, larger shapes that cause repulsive forces, are left out."""
    kept = [index for index, shape in enumerate(robot.shapes) if shape.role == "solid"]
    number = {index: k for k, index in enumerate(kept)}
    pairs = [(number[int(a)], number[int(b)]) for a, b in robot.solid_pairs]
    return replace(
        robot,
        shapes=tuple(robot.shapes[index] for index in kept),
        solid_pairs=np.array(pairs, dtype=np.intp).reshape(-1, 2),
        field_pairs=np.empty((0, 2), dtype=np.intp),
        base_shapes=frozenset(number[index] for index in robot.base_shapes if index in number),
    )


Flags = NDArray[np.bool_]

PROBES = 3  # random poses in which a motor is moved, to see whether it affects a term
_MIN_EFFECT = 1e-9


def needed(problem: Problem, aims: Iterable[Aim]) -> Flags:
    """Return which motors must have random positions in the random start poses of a search, (d,) booleans for the motors that may move.

    True for a motor that moves a link of one of the `aims` (residuals for least squares), and for a motor whose own position is an aim.
    True also for a motor that changes the residual of a term that has a tolerance but no derivative; this is tested in PROBES (3) random
    poses. The term "collision" is left out: if the fingers, for example, began at random positions, they would only cause more contacts.
    """
    moves = _movers(problem.model.robot, aims)[problem.free]
    others = [one for one in problem.terms if one.aims is None and one.tolerance is not None and one.name != "collision"]
    still = np.flatnonzero(~moves)
    if not others or not len(still):
        return moves
    rng, low, high = np.random.default_rng(0), *problem.limits.T
    drawn = rng.uniform(low, high, (PROBES, 1 + len(still), len(low)))
    drawn[:, 1:] = np.where(np.eye(len(low), dtype=bool)[still], drawn[:, 1:], drawn[:, :1])
    pose = problem.model.evaluate(problem.whole(drawn.reshape(-1, len(low))))
    for one in others:
        said = one.residual(pose).reshape(PROBES, -1)
        with np.errstate(invalid="ignore"):  # infinite in both poses
            moves[still[(np.abs(said[:, 1:] - said[:, :1]) > _MIN_EFFECT).sum(axis=0) > 0]] = True
    return moves


def _movers(robot: Robot, aims: Iterable[Aim]) -> Flags:
    """Return whether each motor, (n,), moves a link of an aim or is an aim itself."""
    scale = robot.coupling[0]
    moves = np.zeros(len(robot.motors), dtype=bool)
    for aim in aims:
        if aim.kind == MOTOR:
            moves[aim.motor] = True
        for link in (aim.first_link, aim.second_link):
            while link > 0:
                moves |= scale[link - 1] != 0.0
                link = robot.joints[link - 1].parent
    return moves


Cost = Term | Callable[[Pose, Any], ArrayLike]


class Problem:
    """The search for a pose: a cost, which is a sum of terms, over the d motors that may move; all other motors stay as in `start`.

    Attributes: `model`: the model, with only solid shapes; `terms`: all terms; `by_name`: the same, from name to term; `free` (d,): indices
    of the motors that may move; `limits` (d, 2) rad: their limits, reduced by the margin; `start` (n,) rad: the start pose, moved inside
    these limits; `must`: whether at least one term has a tolerance; `evaluations`: number of evaluated poses.

    Args:
        model: robot and world.
        costs: terms, or functions that take poses and their contacts and return residuals, see `mobee.roadmap.ik.costs.term`.
        start: (n,) rad; None: home.
        motors: names of parts and motors that may move; None: all.
        margin: distance from the limits [rad], at most a quarter of a motor's range; the range of a slide counts as 200 deg.
    """

    def __init__(
        self, model: Model, costs: Sequence[Cost], start: ArrayLike | None, motors: Sequence[str] | None, margin: float = 0.0
    ) -> None:
        robot = model.robot
        require_list(costs)
        self.model = solid_model(model)
        self.by_name = named([cost if isinstance(cost, Term) else term(cost) for cost in costs])
        self.terms = tuple(self.by_name.values())
        if not self.terms:
            raise InvalidValue("costs are empty: give terms of mobee.costs, or functions of pose and contacts.")
        self.free = chosen(robot, motors)
        self.limits = _within(robot.limits[self.free], margin, motor_units(robot)[self.free])
        self.start = _start(model, start)
        self.start[self.free] = np.clip(self.start[self.free], *self.limits.T)
        self.must = any(one.tolerance is not None for one in self.terms)
        self.evaluations = 0

    def whole(self, samples: Array) -> Array:
        """Return poses of all motors (N, n) rad from `samples` (N, d) rad of the motors that may move; the others are at the start."""
        q = np.repeat(self.start[None], len(samples), axis=0)
        q[:, self.free] = samples
        return q

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return the costs (N,) of poses q (N, n) rad, and whether each pose is within all tolerances, (N,)."""
        pose = self.model.evaluate(q)
        self.evaluations += len(q)
        total, good = np.zeros(len(q)), np.ones(len(q), dtype=bool)
        for one in self.terms:
            missing = one.residual(pose)
            total += one.weight * missing
            if one.tolerance is not None:
                good &= missing <= one.tolerance
        return total, good


def require_list(costs: object) -> None:
    """Raise InvalidValue unless the costs are a sequence, and not one term alone."""
    if isinstance(costs, Term) or not isinstance(costs, Sequence):
        raise InvalidValue(f"costs is of type {type(costs).__name__}; give a list of terms, as list(costs) or [term].")


def _within(limits: Array, margin: float, units: Array) -> Array:
    """Return the limits (d, 2) reduced by a margin at both ends, at most by a quarter of a range; `units`: (d,) what counts as 1 rad."""
    if not (np.isfinite(margin) and margin >= 0.0):
        raise InvalidValue(f"margin {margin!r} rad: must be finite and at least 0.")
    kept = np.minimum(margin * units, 0.25 * (limits[:, 1] - limits[:, 0]))
    return np.stack([limits[:, 0] + kept, limits[:, 1] - kept], axis=1)


def chosen(robot: Robot, motors: Sequence[str] | None) -> Ints:
    """Return the sorted indices (d,) of the motors that `motors` names (motors or whole parts); None: all motors.

    Raises UnknownName for an unknown name, and InvalidValue for an empty list.
    """
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
    """Return the terms by name; if a name occurs again, a number is added to it, as in "plane 2"."""
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
