# SPDX-License-Identifier: Apache-2.0
"""Derives from any robot what curious agents need: arms, joints to learn, limits, home, links tested for contacts, and fields.

A field is a volume around a solid (a rigid volume of a link) that causes a repulsive force.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mobee.arrays import Array, checked_seed
from mobee.control.gains import Gains
from mobee.derivation.arms import Chain, bounded, chains, free_name, joints_to_learn, movements, names_of
from mobee.derivation.separation import field_width, free_home, home_apart, often_touching, reach_of, with_cuts, with_fields, without_links
from mobee.errors import InvalidValue
from mobee.learning.lattice import Lattice
from mobee.robot.robot import Clause, Part, Robot

MOST_ARMS = 4  # that learn at once
LEAST_ARM = 0.25  # of the movement of the best arm's joint: what moves its end less is no arm
LEAST_LEVER = 0.1  # of the robot's reach: contacts with shorter levers push less than others, since they hardly move what touches
LEFT_OUT = "solids that touch in most poses, or in every home that was tried"


@dataclass(frozen=True, slots=True)
class Arm:
    """An arm with which a curious agent learns.

    `part`: name of its part. `motors`: names of all motors of the arm. `joints`: names of the motors to learn: the states of the agent are
    the points of a lattice of their positions. `movement`: m, how far one motor moves the end of the arm over the motor's range: mean over
    random poses of the other motors, for the motor with the largest mean; 0 for an arm that the caller of `derive` requested.
    """

    part: str
    motors: tuple[str, ...]
    joints: tuple[str, ...]
    movement: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Derived:
    """A robot that curious agents can use at once, and the derived values.

    `robot`: the robot with all changes. `arms`: the arms that learn. `limited`: names of motors that could turn a joint by more than
    a turn; their range is now one turn. `home_moved`: names of motors whose home was moved, so that at home no solids (rigid
    volumes of links) touch and no fields (volumes that cause repulsive forces) overlap. `narrowed`: names of motors whose range is narrower
    now, because in the rest of the old range some pairs of solids touch and fields cannot prevent it. Where this depends on several motors,
    clauses (conditions on motor positions) were added to the robot instead. `left_out`: pairs of names of links that are no longer tested
    for contacts. `field`: width of the fields that were added [m], 0: none. `gains`: gains of the control law: `Gains.derived()`, or the
    default ones for a robot that has its own fields.
    """

    robot: Robot
    arms: tuple[Arm, ...]
    limited: tuple[str, ...]
    home_moved: tuple[str, ...]
    narrowed: tuple[str, ...]
    left_out: tuple[tuple[str, str], ...]
    field: float
    gains: Gains

    def rest(self, arm: Arm) -> tuple[float, ...]:
        """Return the home of each motor of the arm's part as a fraction of the motor's range, 0 (lower limit) to 1 (upper limit).

        The motors of the part that are not in `arm.joints` stay there while the agent learns.
        """
        part = self.robot.parts[arm.part]
        low, high = self.robot.limits[part.slice].T
        return tuple(np.clip((self.robot.home[part.slice] - low) / (high - low), 0.0, 1.0).round(6).tolist())

    def space(self, arm: Arm) -> Lattice:
        """Return the states and actions of an arm: a lattice of all combinations of three positions of each of `arm.joints`.

        The positions are at 1/4, 1/2 and 3/4 of the joint's range. The other motors of the part stay at home.
        """
        return Lattice(self.robot, arm.joints, rest=self.rest(arm))


def derive(robot: Robot, parts: Mapping[str, Sequence[str]] | None = None, seed: int = 0) -> Derived:
    """Derive arms, joints to learn, limits, home, pairs of links that are tested for contacts, and fields of a robot.

    Fields are volumes around the solids that cause repulsive forces. A robot with more than one part keeps its parts; a robot that has
    fields keeps its fields, its tested pairs and its home.

    Args:
        robot: any robot.
        parts: dict from the name of each part that should learn to the names of its motors to learn, whose positions are the states; None:
            the parts are derived. If the robot has no part of a name, a new part is made of exactly the motors listed for it.
        seed: seed of the random poses in which contacts and movements are measured.

    Raises:
        InvalidValue: no motor moves the end of a chain; a part in `parts` is given no motors, or motors of another part; or `parts` names a
            motor twice; or the seed is no whole number of at least 0; or an argument has another type.
        UnknownName: `parts` names a motor that the robot does not have.
    """
    checked_seed(seed)
    if not isinstance(robot, Robot):
        raise InvalidValue(f"robot is {robot!r}; it must be a Robot, as load_robot returns it.")
    lists = parts.values() if isinstance(parts, Mapping) else [] if parts is None else [None]
    if not all(isinstance(motors, Sequence) and not isinstance(motors, str) for motors in lists):
        raise InvalidValue(f'parts is {parts!r}; it must be a dict from parts to lists of motors, such as {{"arm": ["pan", "bend"]}}.')
    robot, limited = bounded(robot)
    if parts:
        robot, arms = _requested(robot, parts)
    else:
        robot, arms = _arms(robot, seed)
    moved: tuple[str, ...] = ()
    narrowed: tuple[str, ...] = ()
    left_out: set[frozenset[int]] = set()
    width, gains = 0.0, Gains.default()
    if not any(shape.role == "field" for shape in robot.shapes):
        left_out = often_touching(robot, seed)
        robot = without_links(robot, left_out, LEFT_OUT)
        file_home = robot.home
        home, stuck = free_home(robot, seed)
        robot = without_links(_at(robot, home), stuck, LEFT_OUT)
        left_out |= stuck
        reach = _reach(robot, arms)
        robot = replace(_at(robot, home_apart(robot, reach, seed)), least_lever=LEAST_LEVER * reach)
        moved = tuple(name for name, one, other in zip(robot.motors, file_home, robot.home, strict=True) if one != other)
        width = field_width(reach)
        robot, bare = with_fields(robot, robot.solid_pairs, width, seed)
        robot, narrowed, bare = with_cuts(robot, bare, seed)
        robot, _ = with_fields(robot, bare, width, seed, short=0.0)
        gains = Gains.derived()
    names = tuple(sorted((robot.links[min(pair)], robot.links[max(pair)]) for pair in left_out))
    return Derived(robot, arms, tuple(limited), moved, narrowed, names, width, gains)


def _at(robot: Robot, home: Array) -> Robot:
    """Return the robot with another home (n,)."""
    table = tuple(replace(motor, home=float(place)) for motor, place in zip(robot.motor_table, home, strict=True))
    return replace(robot, motor_table=table)


def _reach(robot: Robot, arms: Sequence[Arm]) -> float:
    """Return the length [m] of the longest arm at zero pose, from its first joint to the farthest point that it carries."""
    lengths = []
    for arm in arms:
        first = min(joint for name in arm.motors for joint, _, _ in robot.motor_table[robot.motor_index(name)].joints)
        links = {first + 1}
        for index, joint in enumerate(robot.joints):
            if joint.parent in links:
                links.add(index + 1)
        lengths.append(reach_of(robot, links, first))
    return max(lengths)


def _arms(robot: Robot, seed: int) -> tuple[Robot, tuple[Arm, ...]]:
    """Return the robot, and the arms (chains of joints) whose motors should learn, at most one for each part.

    A robot with one part is divided: each arm and each hand becomes a part, and all other motors are one part. Raises InvalidValue if no
    motor moves the end of a chain.
    """
    drive = {joint: index for index, motor in enumerate(robot.motor_table) for joint, _, _ in motor.joints}
    found: list[tuple[Arm, Chain]] = []
    taken: set[int] = set()
    for chain in chains(robot):
        motors = [k for k in dict.fromkeys(drive[joint] for joint in chain.joints if joint in drive) if k not in taken]
        part = _main_part(robot, motors)
        motors = [k for k in motors if robot.motor_table[k].part == part]
        if motors:
            taken |= set(motors)
            moved = movements(robot, chain, motors, seed)
            joints = joints_to_learn(robot, motors, moved) if moved.max() > 0.0 else ()
            found.append((Arm(part, tuple(robot.motors[k] for k in motors), joints, float(moved.max())), chain))
    several = [one for one in found if len(one[0].motors) > 1] or found
    most = max((arm.movement for arm, _ in several), default=0.0)
    able = [one for one in several if one[0].movement >= LEAST_ARM * most > 0.0]
    if not able:
        raise InvalidValue(f"{robot.name!r} has no chain of joints whose motors move its end: there is nothing to learn.")
    if len(robot.parts) == 1:
        robot, able = _parted(robot, able, drive)
    best: dict[str, Arm] = {}
    for arm, _ in able:
        if arm.part not in best or arm.movement > best[arm.part].movement:
            best[arm.part] = arm
    learning = sorted(best.values(), key=lambda arm: -arm.movement)[:MOST_ARMS]
    return robot, tuple(arm for arm in best.values() if arm in learning)


def _main_part(robot: Robot, motors: Sequence[int]) -> str:
    """Return the part that most of these motors belong to; "" for no motors."""
    parts = [robot.motor_table[motor].part for motor in motors]
    return max(dict.fromkeys(parts), key=parts.count, default="")


def _parted(robot: Robot, arms: list[tuple[Arm, Chain]], drive: dict[int, int]) -> tuple[Robot, list[tuple[Arm, Chain]]]:
    """Return the robot with a part for each arm, one for each hand, and one for all other motors; and the arms with their chains."""
    names = names_of([arm.motors for arm, _ in arms])
    groups: dict[str, tuple[str, ...]] = {}
    dealt = {motor for arm, _ in arms for motor in arm.motors}
    for name, (arm, chain) in zip(names, arms, strict=True):
        groups[name] = arm.motors
        hand = tuple(dict.fromkeys(robot.motors[drive[joint]] for joint in chain.hand if joint in drive))
        hand = tuple(motor for motor in hand if motor not in dealt)
        dealt |= set(hand)
        if hand:
            groups[free_name("hand" if len(arms) == 1 else f"{name}_hand", {*groups, *names})] = hand
    left = tuple(motor for motor in robot.motors if motor not in dealt)
    if left:
        groups[free_name("body", groups)] = left
    return _regrouped(robot, groups), [(replace(arm, part=name), chain) for name, (arm, chain) in zip(names, arms, strict=True)]


def _regrouped(robot: Robot, groups: Mapping[str, Sequence[str]]) -> Robot:
    """Return the robot with these parts, its motors in the order of the parts; each shape belongs to the part that moves its link."""
    order = [robot.motor_index(name) for motors in groups.values() for name in motors]
    of = {name: part for part, motors in groups.items() for name in motors}
    table = tuple(replace(robot.motor_table[k], part=of[robot.motors[k]]) for k in order)
    parts, start = {}, 0
    for part, motors in groups.items():
        parts[part] = Part(part, tuple(motors), start)
        start += len(motors)
    driven = {joint: motor.part for motor in table for joint, _, _ in motor.joints}
    owner = [next(iter(groups))]
    for index, joint in enumerate(robot.joints):
        owner.append(driven.get(index, owner[joint.parent]))
    shapes = tuple(replace(shape, part=owner[shape.link]) for shape in robot.shapes)
    clauses = tuple(Clause(of[robot.motors[int(np.flatnonzero(clause.a[0])[0])]], clause.a[:, order], clause.b) for clause in robot.clauses)
    return replace(robot, motor_table=table, parts=parts, shapes=shapes, clauses=clauses)


def _requested(robot: Robot, wanted: Mapping[str, Sequence[str]]) -> tuple[Robot, tuple[Arm, ...]]:
    """Return the robot with the requested parts, and their arms."""
    for part, motors in wanted.items():
        if not motors:
            raise InvalidValue(f"part {part!r} has no motors: name those that it should learn.")
        of = {robot.motor_table[robot.motor_index(name)].part for name in motors}
        if part in robot.parts and of != {part}:
            raise InvalidValue(f"part {part!r} has not all of {', '.join(motors)}. It has: {', '.join(robot.parts[part].motors)}.")
    named = [name for motors in wanted.values() for name in motors]
    if len(set(named)) < len(named):
        raise InvalidValue(f"a motor is named twice in {', '.join(wanted)}: each motor belongs to one part.")
    unknown = {part: tuple(motors) for part, motors in wanted.items() if part not in robot.parts}
    if unknown:
        dealt = {name for motors in unknown.values() for name in motors}
        rest = {part.name: tuple(name for name in part.motors if name not in dealt) for part in robot.parts.values()}
        robot = _regrouped(robot, unknown | {name: motors for name, motors in rest.items() if motors})
    return robot, tuple(Arm(part, robot.parts[part].motors, tuple(motors)) for part, motors in wanted.items())
