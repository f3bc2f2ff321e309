# SPDX-License-Identifier: Apache-2.0
"""Finds the arms of a robot in its tree: chains of joints that end at a link without further joints, or at a hand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Robot, Shape

HAND = 0.5  # of the length of a chain: branches at its end that are all shorter are the fingers of a hand


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """An arm or leg: a chain of joints from the base, or a branching of the tree, to a hand or to a link without further joints.

    `joints`: indices, the joint nearest to the base first. `end`: index of the last link of the chain. `hand`: indices of all joints that
    this link carries, those of the fingers; empty if there is no hand.
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
