# SPDX-License-Identifier: Apache-2.0
"""Adds motor limits and clauses (conditions on motor positions) to a robot, so that links do not touch.

They are for pairs of links that fields (volumes that cause repulsive forces) cannot keep apart, for example because the links are too near
each other. Whether two links touch depends only on the motors of the joints between them. From the space of the positions of these motors,
half-spaces are cut off until no sampled position is left in which the links touch. A half-space along a single motor becomes a limit of
this motor, any other a clause (thesis eqs. 5.14 to 5.17).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mobee.arrays import Array, Ints
from mobee.control.gains import Gains
from mobee.derivation.joints import with_limits
from mobee.derivation.pairs import can_cut, motors_between
from mobee.model.model import Model
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Clause, LinkPair, Robot

POSES = 3000  # random positions of the motors between two links
SHALLOW = 0.002  # m: an overlap of hulls that does not count
MOST_CUTS = 6  # half-spaces for two links
DIRECTIONS = 48  # of touching positions from home, across which a cut is tried
QUANTILES = (0.25, 0.5, 1.0)  # of the touching positions in a direction that a cut leaves out
LIMIT_GAP = np.deg2rad(2.0)  # rad between home and a limit
CLAUSE_GAP = 1.02 * Gains.default().constraint_width  # rad between home and a clause, which does not push at home
MOST_LEFT = 0.2  # share of the touching positions within all cuts: with more, fields are needed too
LEAST_FREE = 0.05  # share of the free positions that must remain within all cuts
ALONE = 0.7  # factor of the cost of a cut along one motor: it is a limit, and levels of a lattice stay within limits


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Links that the same motors move against each other, and positions of these motors relative to home: touching ones and free ones."""

    motors: tuple[int, ...]
    pairs: Ints  # (p, 2) of shapes
    touching: Array  # (t, k) rad of the law
    free: Array  # (f, k) rad of the law


def with_cuts(robot: Robot, pairs: Ints, seed: int) -> tuple[Robot, tuple[str, ...], Ints]:
    """Add motor limits, and clauses (conditions on several motor positions), that keep pairs of solids from touching.

    Returns the changed robot, the names of the motors whose range is narrower now, and the pairs (r, 2) for which this fails. Those pairs
    need fields (volumes that cause repulsive forces), because more than MOST_LEFT (20 %) of the sampled positions in which the solids touch
    are still allowed. Pairs with the same motors between them are judged together. `pairs` (p, 2): indices of shapes. Pairs with more than
    MOST_MOTORS (3) motors between them, or with motors of several parts between them, are left as they are and not returned. `seed`: seed
    of the samples.
    """
    narrowed: dict[int, Array] = {}
    clauses: list[Clause] = []
    failed = [pairs[:0]]
    units = motor_units(robot)
    for group in _groups(robot, pairs, seed):
        cuts = list(_cuts(group))
        within = np.ones(len(group.touching), dtype=bool)
        for normal, offset in cuts:
            within &= group.touching @ normal > offset
        if within.mean() > MOST_LEFT:
            failed.append(group.pairs)
        for normal, offset in cuts:
            used = np.flatnonzero(normal)
            if len(used) == 1:
                motor = group.motors[int(used[0])]
                limits = narrowed.setdefault(motor, robot.limits[motor].copy())
                end = robot.home[motor] + offset * units[motor] * normal[used[0]]
                if normal[used[0]] > 0.0:
                    limits[0] = max(limits[0], end)
                else:
                    limits[1] = min(limits[1], end)
            else:
                row = np.zeros((1, len(robot.motors)))
                row[0, list(group.motors)] = normal / units[list(group.motors)]
                clauses.append(Clause(robot.motor_table[group.motors[0]].part, row, -row @ robot.home - offset))
    robot = with_limits(robot, narrowed)
    return replace(robot, clauses=(*robot.clauses, *clauses)), tuple(robot.motors[k] for k in sorted(narrowed)), np.concatenate(failed)


def _groups(robot: Robot, pairs: Ints, seed: int) -> Iterator[_Group]:
    """Yield the groups of links with few motors of one part between them, the fewest motors first."""
    of: dict[tuple[int, ...], list[list[int]]] = {}
    for pair in pairs.tolist():
        links: LinkPair = frozenset(robot.shapes[index].link for index in pair)
        if can_cut(robot, links):
            of.setdefault(tuple(motors_between(robot, [links]).tolist()), []).append(pair)
    rng = np.random.default_rng(seed)
    for motors, members in sorted(of.items(), key=lambda one: (len(one[0]), one[0])):
        low, high = robot.limits[list(motors)].T
        drawn = rng.uniform(low, high, (POSES, len(motors)))
        poses = np.repeat(robot.home[None], POSES, axis=0)
        poses[:, motors] = drawn
        tested = replace(robot, field_pairs=robot.field_pairs[:0], solid_pairs=np.array(members, dtype=np.intp))
        table = Model(tested).evaluate(poses).table
        touching = np.zeros(POSES, dtype=bool)
        touching[table.pose[table.depth > SHALLOW]] = True
        away = (drawn - robot.home[list(motors)]) / motor_units(robot)[list(motors)]
        if touching.any():
            yield _Group(motors, np.array(members, dtype=np.intp), away[touching], away[~touching])


def _cuts(group: _Group) -> Iterator[tuple[Array, float]]:
    """Yield half-spaces normal . x > offset that hold at home, x = 0, until no touching position satisfies all of them."""
    touching, free, rest = group.touching, group.free, len(group.free)
    for _ in range(MOST_CUTS):
        if not len(touching):
            return
        best = min(_candidates(touching, free), key=lambda one: one[0], default=None)
        if best is None:
            return
        _, normal, offset = best
        kept = free @ normal > offset
        if kept.sum() < LEAST_FREE * rest:
            return
        touching, free = touching[touching @ normal > offset], free[kept]
        yield normal, offset


def _candidates(touching: Array, free: Array) -> Iterator[tuple[float, Array, float]]:
    """Yield cuts with their cost: the number of free positions lost per touching position that is excluded."""
    count = touching.shape[1]
    axes = [sign * axis for axis in np.eye(count) for sign in (1.0, -1.0)]
    chosen = touching[:: max(1, len(touching) // DIRECTIONS)]
    towards = [-one / np.linalg.norm(one) for one in chosen if count > 1 and np.linalg.norm(one) > CLAUSE_GAP]
    for normal, gap, weight in [*((axis, LIMIT_GAP, ALONE) for axis in axes), *((one, CLAUSE_GAP, 1.0) for one in towards)]:
        behind = np.sort(touching @ normal)
        behind = behind[behind < -gap]
        if not len(behind):
            continue
        for share in QUANTILES:
            number = max(1, int(share * len(behind)))
            offset = float(behind[number - 1])
            lost = int((free @ normal <= offset).sum())
            yield weight * (lost + 1.0) / number, normal, offset
