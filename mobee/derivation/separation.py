# SPDX-License-Identifier: Apache-2.0
"""Keeps the links of a robot apart: chooses the pairs of links to be tested, fields, limits, and a home without contacts.

Pairs of links that touch in most poses are not tested for contacts. The other pairs are kept apart by fields (volumes that cause repulsive
forces), or by motor limits and clauses (conditions on motor positions) where fields cannot do it, for example because the links are too
near each other. Whether two links touch depends only on the motors of the joints between them. From the space of the positions of these
motors, half-spaces are cut off until no sampled position is left in which the links touch. A half-space along a single motor becomes a
limit of this motor, any other a clause (thesis eqs. 5.14 to 5.17).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from mobee.arrays import Array, Ints
from mobee.control.gains import Gains
from mobee.derivation.arms import corners_of, with_limits
from mobee.model.kinematics import lever, tables
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.robot.motor_units import angle_unit, motor_units, outside_zones, slides
from mobee.robot.robot import Clause, LinkPair, Robot, Shape
from mobee.robot.urdf.hull import convex_hull
from mobee.robot.urdf.shapes import grown

POSES = 300  # random ones
OFTEN = 0.5  # of them: solids that touch in more overlap by design, or only as hulls
FIELD_OFTEN = 0.6  # the same for fields, which would push there nearly always
FIELD_SHARE = 0.06  # of the robot's reach: the width of its fields
NARROWEST, WIDEST = 0.005, 0.06  # m
SIZES = {"": 1.0, "_near": 0.5, "_nearer": 0.25, "_nearest": 0.125}  # of that width, by the ending of the field's name
AT_HOME = 0.5  # of that width: fields that should not meet at home
MOST_MOTORS = 3  # between two links that limits and clauses keep apart: with more, too many positions would have to be drawn
LEVERS = 8  # contacts of a pair whose levers are computed
SHORT = 2.0  # least levers: near the least lever the push of a contact may change its sign with the pose
ROUNDS, DRAWS = 8, 128  # of the search for a home
SAMPLES = 3000  # random positions of the motors between two links
SHALLOW = 0.002  # m: an overlap of hulls that does not count
MOST_CUTS = 6  # half-spaces for two links
DIRECTIONS = 48  # of touching positions from home, across which a cut is tried
QUANTILES = (0.25, 0.5, 1.0)  # of the touching positions in a direction that a cut leaves out
LIMIT_GAP = np.deg2rad(2.0)  # rad between home and a limit
CLAUSE_GAP = 1.02 * Gains.default().constraint_width  # rad between home and a clause, which does not push at home
MOST_LEFT = 0.2  # share of the touching positions within all cuts: with more, fields are needed too
LEAST_FREE = 0.05  # share of the free positions that must remain within all cuts
ALONE = 0.7  # factor of the cost of a cut along one motor: it is a limit, and levels of a lattice stay within limits


def without_links(robot: Robot, pairs: Collection[LinkPair], reason: str) -> Robot:
    """Return a copy of the robot in which some pairs of links are not tested for contacts; `reason`: recorded for each of them."""
    link = np.array([shape.link for shape in robot.shapes], dtype=np.intp)

    def kept(table: Ints) -> Ints:
        return table[[frozenset(link[pair].tolist()) not in pairs for pair in table]] if len(table) else table

    untested = dict.fromkeys(pairs, reason) | dict(robot.untested)
    return replace(robot, solid_pairs=kept(robot.solid_pairs), field_pairs=kept(robot.field_pairs), untested=untested)


def often_touching(robot: Robot, seed: int, share: float = OFTEN) -> set[LinkPair]:
    """Return the pairs of links (as sets of two indices) with solids that touch in more than the fraction `share` of random poses.

    `seed`: seed of the poses.
    """
    counts = _counted(replace(robot, field_pairs=robot.field_pairs[:0]), seed)
    links: Counter[LinkPair] = Counter()
    for (first, second), count in counts.items():
        pair = frozenset((robot.shapes[first].link, robot.shapes[second].link))
        links[pair] = max(links[pair], count)
    return {pair for pair, count in links.items() if count > share * POSES}


def _counted(robot: Robot, seed: int) -> Counter[tuple[int, int]]:
    """Return in how many of POSES random poses each pair of shapes touches."""
    return _counts(Model(robot).evaluate(_drawn(robot, seed)))


def _drawn(robot: Robot, seed: int) -> Array:
    low, high = robot.limits.T
    return np.random.default_rng(seed).uniform(low, high, (POSES, len(low)))


def _counts(pose: Pose) -> Counter[tuple[int, int]]:
    return Counter(tuple(sorted(pair)) for pair in pose.table.numbers[:, [2, 3]].tolist())


def _short_levers(pose: Pose, short: float) -> set[tuple[int, int]]:
    """Return the pairs of shapes with short levers that limits or clauses can keep apart (see `can_cut`).

    The lever of a contact is the norm of the derivatives of its depth by the motors. The levers of a pair are short if their median over
    some of its contacts (at most 15) in the poses of `pose` is below `short` times `Robot.least_lever`.
    """
    robot, table = pose.robot, pose.table
    rows: dict[tuple[int, int], list[int]] = {}
    for row, (first, second) in enumerate(table.numbers[:, [2, 3]].tolist()):
        rows.setdefault((min(first, second), max(first, second)), []).append(row)
    found = set()
    for pair, own in rows.items():
        if not can_cut(robot, frozenset(robot.shapes[index].link for index in pair)):
            continue
        some = own[:: max(1, len(own) // LEVERS)]
        if np.median([_lever_of(pose, row) for row in some]) < short * robot.least_lever:
            found.add(pair)
    return found


def _lever_of(pose: Pose, row: int) -> float:
    table = pose.table
    links = int(table.first_link[row]), int(table.second_link[row])
    return lever(pose.robot, pose.transforms[table.pose[row]], links, table.point[row], table.normal[row])


def can_cut(robot: Robot, links: LinkPair) -> bool:
    """Return whether the motors that move two links against each other are one to MOST_MOTORS (3) motors of one part.

    Only then motor limits, and clauses (conditions on motor positions), can keep the two links apart.
    """
    motors = motors_between(robot, [links])
    return 0 < len(motors) <= MOST_MOTORS and len({robot.motor_table[k].part for k in motors.tolist()}) == 1


def free_home(robot: Robot, seed: int) -> tuple[Array, set[LinkPair]]:
    """Return a home (n,) near the robot's home in which as few solids as possible touch, and the pairs of links that still touch.

    Positions are in the units of the motors, rad or m. Pairs of links are sets of two indices. Only the motors between links that touch are
    moved, to random positions around the best position so far. The range of these positions grows in each round of the search. `seed`: seed
    of the random positions.
    """
    solids = replace(robot, field_pairs=robot.field_pairs[:0])
    model, rng = Model(solids), np.random.default_rng(seed)
    inner = _inside(robot)
    best, touching = robot.home.copy(), _touching(model, robot.home)
    for round_ in range(ROUNDS):
        if not touching:
            break
        movable = motors_between(robot, touching)
        reach = (round_ + 1) / ROUNDS * np.ptp(inner, axis=1)
        draws = np.repeat(best[None], DRAWS, axis=0)
        draws[:, movable] += rng.uniform(-1.0, 1.0, (DRAWS, len(movable))) * reach[movable]
        draws[:, movable] = np.clip(draws[:, movable], *inner[movable].T)
        counts = np.asarray(model.evaluate(draws).count)
        apart = np.abs((draws - robot.home) / np.maximum(np.ptp(robot.limits, axis=1), 1e-9)).sum(axis=1)
        chosen = int(np.lexsort((apart, counts))[0])
        if counts[chosen] < len(model.evaluate(best).contacts):
            best, touching = draws[chosen], _touching(model, draws[chosen])
    return best, touching


def _inside(robot: Robot) -> Array:
    """Return the range of each motor between its limit zones, (n, 2)."""
    found = []
    for motor in robot.motor_table:
        unit = angle_unit(motor.limits, slides(robot, motor))
        found.append([outside_zones(float(end), motor.limits, unit) for end in motor.limits])
    return np.array(found)


def _touching(model: Model, q: Array) -> set[LinkPair]:
    links = {shape.name: shape.link for shape in model.robot.shapes}
    return {frozenset((links[contact.first], links[contact.second])) for contact in model.evaluate(q).contacts}


def motors_between(robot: Robot, pairs: Collection[LinkPair]) -> Ints:
    """Return the indices of the motors that move the two links of any of these pairs against each other, in ascending order."""
    moving: set[int] = set()
    ancestry = tables(robot).ancestry
    for pair in pairs:
        first, second = (set(ancestry[link].tolist()) for link in pair)
        moving |= first ^ second
    motors = np.flatnonzero(robot.coupling[0][sorted(moving)].any(axis=0))
    return motors


def field_width(reach: float) -> float:
    """Return the width [m] of the fields to be added to a robot, the distance by which they extend beyond the solids.

    A field is a volume around a solid that causes a repulsive force. The width is 6 % of `reach`, the length [m] of the robot's longest
    arm, and at least 5 mm and at most 6 cm.
    """
    return float(np.clip(FIELD_SHARE * reach, NARROWEST, WIDEST))


def with_fields(robot: Robot, pairs: Ints, width: float, seed: int, short: float = SHORT) -> tuple[Robot, Ints]:
    """Add fields (volumes that cause repulsive forces) around solids; return the robot, and the pairs (r, 2) of solids that get none.

    `pairs`: (p, 2) indices of shapes, the pairs of solids that fields should keep apart. `width`: m, distance by which fields extend beyond
    the solids. A pair gets fields of the full width, or else of 1/2, 1/4 or 1/8 of it. A width is not used for a pair in two cases.
    First, its fields would overlap at home or in more than FIELD_OFTEN (60 %) of random poses. Second, the levers of the pair are short,
    and motor limits and clauses (conditions on motor positions) can keep the pair apart instead (see `can_cut`). The lever of a contact is
    the norm of the derivatives of its depth with respect to the motors. The levers are short if their median, over some of the random
    poses in which the fields overlap, is below `short` times `Robot.least_lever`. `seed`: seed of the random poses.
    """
    for suffix, size in SIZES.items():
        robot, pairs = _with_fields(robot, pairs, size * width, suffix, seed, short)
    return robot, pairs


def home_apart(robot: Robot, reach: float, seed: int) -> Array:
    """Return a home (n,) near the robot's home in which no solids touch, and in which there is room for fields between them.

    Fields are volumes around solids that cause repulsive forces. There is room if fields of half the width `field_width` would not overlap;
    pairs whose fields would overlap in more than FIELD_OFTEN (60 %) of random poses are not tested. If no such home is found, the one with
    the fewest contacts is returned. Positions are in the units of the motors, rad or m. `reach`: m, length of the robot's longest arm.
    `seed`: seed of the random search.
    """
    width = AT_HOME * field_width(reach)
    needed = sorted(set(robot.solid_pairs.ravel().tolist()))
    wide = tuple(replace(_field(robot.shapes[index], width, "_wide"), role="solid") for index in needed)
    number = {index: len(robot.shapes) + k for k, index in enumerate(needed)}
    pairs = np.array([[number[a], number[b]] for a, b in robot.solid_pairs.tolist()], dtype=np.intp).reshape(-1, 2)
    trial = replace(robot, shapes=(*robot.shapes, *wide), solid_pairs=pairs)
    trial = without_links(trial, often_touching(trial, seed, FIELD_OFTEN), "near each other in most poses")
    return free_home(replace(trial, solid_pairs=np.concatenate([robot.solid_pairs, trial.solid_pairs])), seed)[0]


def _with_fields(robot: Robot, pairs: Ints, width: float, suffix: str, seed: int, short: float) -> tuple[Robot, Ints]:
    """Add fields of one width for these pairs of solids; return the robot and the pairs (r, 2) of solids that do not get them.

    `width`: m. `suffix`: end of the names of the fields. A pair gets none under the conditions in `with_fields`: the fields overlap too
    often or at home, or the pair has short levers (see `short` there).
    """
    needed = sorted(set(pairs.ravel().tolist()))
    fields = [_field(robot.shapes[index], width, suffix) for index in needed]
    known = {shape.name: index for index, shape in enumerate(robot.shapes)}
    fields = [field for field in fields if field.name not in known]
    known |= {field.name: len(robot.shapes) + k for k, field in enumerate(fields)}
    number = {index: known[_name(robot.shapes[index], suffix)] for index in needed}
    base = {number[index] for index in needed if index in robot.base_shapes}
    wanted = np.array([[number[a], number[b]] for a, b in pairs.tolist()], dtype=np.intp).reshape(-1, 2)
    grown_robot = replace(robot, shapes=(*robot.shapes, *fields), base_shapes=robot.base_shapes | base)
    trial = replace(grown_robot, solid_pairs=robot.solid_pairs[:0], field_pairs=wanted)
    pose = Model(trial).evaluate(_drawn(trial, seed))
    often = {pair for pair, count in _counts(pose).items() if count > FIELD_OFTEN * POSES} | _short_levers(pose, short)
    names = {shape.name: index for index, shape in enumerate(trial.shapes)}
    often |= {(min(pair), max(pair)) for c in Model(trial).evaluate(robot.home).contacts for pair in [(names[c.first], names[c.second])]}
    meets = np.array([(min(pair), max(pair)) in often for pair in wanted.tolist()], dtype=bool)
    kept = np.concatenate([robot.field_pairs.reshape(-1, 2), wanted[~meets]])
    return replace(grown_robot, field_pairs=kept), pairs[meets]


ICOSAHEDRON = np.array([np.roll((0.0, a, b), k) for a in (-1.0, 1.0) for b in (-1.618034, 1.618034) for k in range(3)]) / 1.511523
"""The corners (12, 3) of an icosahedron that contains the ball of radius 1."""
FIELD_CORNERS = 32


def _name(solid: Shape, suffix: str) -> str:
    return f"{solid.name}_field{suffix}"


def _field(solid: Shape, width: float, suffix: str) -> Shape:
    """Return the field that reaches `width` [m] farther than a solid; around a hull it is a hull, closer than a capsule would be."""
    name = _name(solid, suffix)
    if solid.vertices is None:
        return grown(solid, width, name)
    cloud = (solid.vertices[:, None] + width * ICOSAHEDRON).reshape(-1, 3)
    return replace(solid, name=name, role="field", vertices=convex_hull(cloud, FIELD_CORNERS))


def reach_of(robot: Robot, links: Collection[int], joint: int) -> float:
    """Return the distance [m] from a joint to the farthest point of the shapes of some links at zero pose.

    `links`, `joint`: indices. If the links have no shapes, it is the distance to the farthest of their joints.
    """
    points = [corners_of(shape) for shape in robot.shapes if shape.link in links]
    points = points or [robot.joints[link - 1].point[None] for link in links]
    return float(np.linalg.norm(np.concatenate(points) - robot.joints[joint].point, axis=1).max())


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


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """Links that the same motors move against each other, and positions of these motors relative to home: touching ones and free ones."""

    motors: tuple[int, ...]
    pairs: Ints  # (p, 2) of shapes
    touching: Array  # (t, k) rad of the law
    free: Array  # (f, k) rad of the law


def _groups(robot: Robot, pairs: Ints, seed: int) -> Iterator[_Group]:
    """Yield groups of pairs of shapes, the fewest motors first; in a group, the same motors move the links of all pairs against each other.

    Only groups with one to three motors of one part (`can_cut`), some of whose solids touch in random poses, are yielded.
    """
    of: dict[tuple[int, ...], list[list[int]]] = {}
    for pair in pairs.tolist():
        links: LinkPair = frozenset(robot.shapes[index].link for index in pair)
        if can_cut(robot, links):
            of.setdefault(tuple(motors_between(robot, [links]).tolist()), []).append(pair)
    rng = np.random.default_rng(seed)
    for motors, members in sorted(of.items(), key=lambda one: (len(one[0]), one[0])):
        low, high = robot.limits[list(motors)].T
        drawn = rng.uniform(low, high, (SAMPLES, len(motors)))
        poses = np.repeat(robot.home[None], SAMPLES, axis=0)
        poses[:, motors] = drawn
        tested = replace(robot, field_pairs=robot.field_pairs[:0], solid_pairs=np.array(members, dtype=np.intp))
        table = Model(tested).evaluate(poses).table
        touching = np.zeros(SAMPLES, dtype=bool)
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
    """Yield possible cuts (half-spaces normal . x > offset, a condition on motor positions x) as tuples (cost, normal, offset).

    The cost is (free positions that the cut excludes + 1) / (touching positions that it excludes), times ALONE for a cut by one motor.
    """
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
