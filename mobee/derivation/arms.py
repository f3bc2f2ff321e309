# SPDX-License-Identifier: Apache-2.0
"""Finds the arms of a robot, names them, and chooses the joints with which they learn.

An arm is a chain of joints in the robot's tree that ends at a link without further joints, or at a hand. Its joints to learn are those that
move its end most. Its name consists of the words that the names of its motors have in common. Motors with a range of more than a turn are
limited to one turn.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mobee.arrays import Array
from mobee.model.kinematics import link_transforms
from mobee.robot.motor_units import slides
from mobee.robot.robot import Motor, Robot, Shape

HAND = 0.5  # of the length of a chain: branches at its end that are all shorter are the fingers of a hand
MOST_JOINTS = 4  # of one arm: 3 levels of each make 81 states
LEAST_SHARE = 0.1  # of the movement of the best joint: one that moves the end less is left out
POSES, LEVELS = 16, 5  # random poses, and places in the range of the joint, over which movement is measured
TURN = 2.0 * np.pi
SIDES = {"l": "left", "left": "left", "r": "right", "right": "right"}
LIMBS = {
    "leg": ("hip", "knee", "ankle", "leg", "thigh", "calf", "haa", "hfe", "kfe"),
    "arm": ("shoulder", "elbow", "wrist", "arm"),
    "head": ("neck", "head"),
}
COMMON = ("joint", "link", "motor", "actuator", "j", "robot")  # words that say nothing about a part
LONGEST = 24  # letters of a name, which stands in the keys of the bus


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """An arm or leg: a chain of joints in the tree of the robot. It starts at the base or where the tree branches.

    It ends at a hand, or at a link without further joints. `joints`: indices, the joint nearest to the base first. `end`: index of the last
    link of the chain. `hand`: indices of all joints that the last link carries, those of the fingers; empty if there is no hand.
    """

    joints: tuple[int, ...]
    end: int
    hand: tuple[int, ...] = ()


def chains(robot: Robot) -> list[Chain]:
    """Return the chains of joints that can be arms or legs, in depth-first order of the tree, branches by index of their joints.

    A chain ends at a link without further joints, or at a hand. Where the tree branches, a branch is short if its length is less than HAND
    (0.5) times the length of the chain before it; otherwise it is long. If all branches are short, they are the fingers of a hand, and the
    chain ends there. If some are long, the short ones are ignored. If exactly one is long, the chain continues in it (unless the chain has
    only one joint). Otherwise each long branch begins a new chain, and the joints before the branching are a trunk, which belongs to no
    chain.
    """
    tree = _Tree(robot)
    found: list[Chain] = []
    waiting: list[tuple[int, ...]] = [(joint,) for joint in reversed(tree.below[0])]
    while waiting:
        joints = waiting.pop()
        link = joints[-1] + 1
        branches = tree.below[link]
        if not branches:
            found.append(Chain(joints, link))
        elif len(branches) == 1:
            waiting.append((*joints, branches[0]))
        else:
            own = tree.length(joints)
            long = [joint for joint in branches if tree.extent[joint + 1] >= HAND * own]
            if not long:
                found.append(Chain(joints, link, tuple(tree.subtree(link))))
            elif len(long) == 1 and len(joints) > 1:
                waiting.append((*joints, long[0]))
            else:
                waiting += [(joint,) for joint in reversed(long)]
    return found


class _Tree:
    """The joints on each link, and the extent of each link: the path length from its joint to the farthest end that it carries."""

    def __init__(self, robot: Robot) -> None:
        self._points = [joint.point for joint in robot.joints]
        self.below: list[list[int]] = [[] for _ in robot.links]
        for index, joint in enumerate(robot.joints):
            self.below[joint.parent].append(index)
        self.extent = [0.0 for _ in robot.links]  # m from the joint of a link to the farthest end, along the tree
        for shape in robot.shapes:
            if shape.link and shape.role == "solid":
                far = float(np.linalg.norm(corners_of(shape) - self._points[shape.link - 1], axis=1).max())
                self.extent[shape.link] = max(self.extent[shape.link], far)
        for index in reversed(range(len(robot.joints))):  # parents come first
            parent = robot.joints[index].parent
            if parent:
                step = float(np.linalg.norm(self._points[index] - self._points[parent - 1]))
                self.extent[parent] = max(self.extent[parent], step + self.extent[index + 1])

    def length(self, joints: Sequence[int]) -> float:
        """Return the length of a chain [m]: from joint to joint, and from the last one to the farthest of the joints on its last link."""
        points = [self._points[joint] for joint in joints]
        steps = sum(float(np.linalg.norm(b - a)) for a, b in zip(points, points[1:], strict=False))
        ends = [float(np.linalg.norm(self._points[joint] - points[-1])) for joint in self.below[joints[-1] + 1]]
        return steps + max(ends, default=0.0)

    def subtree(self, link: int) -> Iterator[int]:
        """Yield the joints that a link carries."""
        for joint in self.below[link]:
            yield joint
            yield from self.subtree(joint + 1)


def corners_of(shape: Shape) -> Array:
    """Return points (k, 3) m of a shape, root frame at zero pose, that mark its extent.

    They are the corners of a box or hull. For a sphere, capsule or cylinder they are only the two ends on its z axis.
    """
    if shape.vertices is not None:
        local = shape.vertices
    elif shape.kind == "box":
        local = np.array(np.meshgrid(*[(-edge / 2.0, edge / 2.0) for edge in shape.size])).reshape(3, -1).T
    else:
        half = shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0
        reach = half + (shape.size[0] if shape.kind != "cylinder" else 0.0)
        local = np.array([[0.0, 0.0, reach], [0.0, 0.0, -reach]])
    placed: Array = local @ shape.rotation.T + shape.position
    return placed


def end_point(robot: Robot, chain: Chain) -> Array:
    """Return the end point of a chain, (3,) m, root frame at zero pose, for measuring how far the joints move the end.

    It is the mean position of the solids of the last link and of its hand. If these links have no solids, it is the mean position of their
    markers; if they have no markers either, of the joints of the hand. Without a hand it is then the last joint of the chain.
    """
    links = {chain.end, *(joint + 1 for joint in chain.hand)}
    middles = [shape.position for shape in robot.shapes if shape.link in links and shape.role == "solid"]
    middles = middles or [marker.position for marker in robot.markers.values() if marker.link in links]
    middles = middles or [robot.joints[joint].point for joint in chain.hand]
    point: Array = np.mean(middles, axis=0) if middles else robot.joints[chain.end - 1].point
    return point


def bounded(robot: Robot) -> tuple[Robot, list[str]]:
    """Limit every motor that can turn a joint by more than a turn to one turn; return the robot and the names of the changed motors.

    With a larger range, positions one turn apart are the same pose, so that several states of a lattice would be the same pose. For a motor
    that drives joints with other scales than 1, the turn is that of the joint that moves most. The middle of the new range is 0, or home if
    home is more than half a turn from 0. If the new range would exceed the old limits, it is shifted into them.
    """
    table = []
    for motor in robot.motor_table:
        scale = max((abs(scale) for _, scale, _ in motor.joints), default=1.0)
        if np.ptp(motor.limits) * scale >= TURN - 1e-6 and not slides(robot, motor):
            centre = motor.home if abs(motor.home) > np.pi / scale else 0.0
            low, high = motor.limits
            centre = float(np.clip(centre, low + np.pi / scale, max(high - np.pi / scale, low + np.pi / scale)))
            limits = np.clip(centre + np.array([-np.pi, np.pi]) / scale, low, high)
            motor = replace(motor, limits=limits, home=float(np.clip(motor.home, *limits)))
        table.append(motor)
    narrowed = [name for name, one, other in zip(robot.motors, robot.motor_table, table, strict=True) if np.any(one.limits != other.limits)]
    return _with_motors(robot, table), narrowed


def with_limits(robot: Robot, limits: Mapping[int, Array]) -> Robot:
    """Return a copy of the robot with new limits of some motors.

    The home position of each of these motors is clipped to its new limits, and the limits of the joints that it drives are computed again
    from them. `limits`: dict from the index of a motor to its lowest and highest position (2,), in the unit of the motor, rad or m.
    """
    table = [
        replace(motor, limits=limits[k], home=float(np.clip(motor.home, *limits[k]))) if k in limits else motor
        for k, motor in enumerate(robot.motor_table)
    ]
    return _with_motors(robot, table)


def _with_motors(robot: Robot, table: Sequence[Motor]) -> Robot:
    """Return the robot with other motors, and with the limits of its joints that follow from these."""
    moved = {j: np.sort(scale * motor.limits + shift) for motor in table for j, scale, shift in motor.joints}
    joints = tuple(replace(joint, limits=moved.get(index, joint.limits)) for index, joint in enumerate(robot.joints))
    return replace(robot, joints=joints, motor_table=tuple(table))


def movements(robot: Robot, chain: Chain, motors: Sequence[int], seed: int) -> Array:
    """Return how far each motor moves the end of a chain over the motor's range, (k,) m: the mean over random poses of the other motors.

    `motors`: indices of the k motors. `seed`: seed of the random poses.
    """
    low, high = robot.limits.T
    point = end_point(robot, chain)
    poses = np.random.default_rng(seed).uniform(low, high, (POSES, len(low)))
    found = np.zeros(len(motors))
    for number, motor in enumerate(motors):
        q = np.repeat(poses[:, None], LEVELS, axis=1)
        q[:, :, motor] = np.linspace(low[motor], high[motor], LEVELS)
        transforms = link_transforms(robot, q)[..., chain.end, :, :]
        places = transforms[..., :3, :3] @ point + transforms[..., :3, 3]  # (POSES, LEVELS, 3)
        apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
        found[number] = apart.max(axis=(1, 2)).mean()
    return found


def joints_to_learn(robot: Robot, motors: Sequence[int], moved: Array) -> tuple[str, ...]:
    """Return the names of the motors that move the end of an arm most, at most MOST_JOINTS (4), in the order of `motors`.

    `motors`: indices of the k motors of the arm. `moved`: (k,) m, how far each motor moves the end; motors below 10 % of the largest value
    are left out.
    """
    best = [k for k in np.argsort(-moved, kind="stable")[:MOST_JOINTS] if moved[k] >= LEAST_SHARE * moved.max()]
    return tuple(robot.motors[motors[k]] for k in sorted(best))


def names_of(groups: Sequence[Sequence[str]]) -> list[str]:
    """Return a name for each group of motors, from the words that the names of its motors have in common: "left_arm", "fl_leg", "arm_2".

    The limb that the motors' names indicate (leg, arm or head) is added if the words do not contain it. The name is "arm" if there is no
    word, and only the limb if there is one group. The names are all different and have only a-z, 0-9 and _. `groups`: for each group the
    names of its motors.
    """
    names: list[str] = []
    for motors in groups:
        names.append(free_name(_name(motors, len(groups) == 1), names))
    return names


def free_name(name: str, taken: Container[str]) -> str:
    """Return the name, with a number from 2 on appended if it is one of the `taken` names."""
    free, number = name, 2
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    return free


def _name(motors: Sequence[str], alone: bool) -> str:
    words = [_words(motor) for motor in motors]
    limb = next((limb for limb, hints in LIMBS.items() if any(_hinted(word, hints) for one in words for word in one)), "")
    if alone:
        return limb or "arm"
    shared = [word for word in words[0] if all(word in other for other in words) and word not in COMMON and not word.isdecimal()]
    shared = [SIDES.get(word, word) for word in shared]
    if limb and not any(_hinted(word, (limb,)) for word in shared):
        shared.append(limb)
    return "_".join(dict.fromkeys(shared))[:LONGEST].strip("_") or "arm"


def _hinted(word: str, hints: Sequence[str]) -> bool:
    return any(word.startswith(hint) for hint in hints)


def _words(name: str) -> list[str]:
    """Return the words of a name in lower case: of "LeftElbowPitch", "robot/left-elbow_pitch" and "left_elbow_pitch" the same three."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+", name)]
