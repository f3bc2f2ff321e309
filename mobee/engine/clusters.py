"""Groups of shapes that stay together, a hand or a head: what is far from a group is far from all of it.

Links are merged with the group of the link that carries them as long as the group stays small, judged in random poses of the
joints.  The shapes of a group stand side by side in the packed robot; groups never mix solids and fields, which never meet.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from mobee.engine.volumes import Volumes
from mobee.robot.robot import Array, Ints, Robot

SMALL = 0.25  # of the robot's own radius; measured on the benchmark: 0.1 and 0.5 make the broad phase a fifth slower
SAMPLES = 16
Flags = NDArray[np.bool_]

_CACHE: WeakKeyDictionary[Robot, list[list[int]]] = WeakKeyDictionary()


def clusters(robot: Robot, rows: Volumes, link: Ints, field: Flags, own: int) -> list[list[int]]:
    """Indices of shapes, group by group; from `own` on they are carried objects, each a group of its own."""
    groups = _CACHE.get(robot)  # what is carried changes while the robot moves, its own groups never do
    if groups is None:
        groups = _CACHE[robot] = _own_clusters(robot, rows[:own], link[:own], field[:own])
    return groups + [[index] for index in range(own, len(rows))]


def _own_clusters(robot: Robot, rows: Volumes, link: Ints, field: Flags) -> list[list[int]]:
    centers = _sampled_centers(robot, rows, link)
    groups: list[list[int]] = []
    for kind in (False, True):
        members = [[int(i) for i in np.flatnonzero((link == k) & (field == kind))] for k in range(len(robot.links))]
        groups += _merge(robot, members, centers, rows["bound"])
    return [sorted(group, key=lambda index: rows["kind"][index]) for group in groups]  # runs of one kind are guessed right


def _merge(robot: Robot, members: list[list[int]], centers: Array, bound: Array) -> list[list[int]]:
    """Merge every link, leaves first, into the group of the link that carries it where the two together are small."""
    present = [i for group in members for i in group]
    if not present:
        return []
    limit = SMALL * _radius(centers, bound, present)
    groups = [list(group) for group in members]
    for joint in range(len(robot.joints) - 1, -1, -1):
        parent, child = robot.joints[joint].parent, joint + 1
        if not groups[child]:
            continue
        if not groups[parent] or _radius(centers, bound, groups[parent] + groups[child]) < limit:
            groups[parent], groups[child] = groups[parent] + groups[child], []
    return [group for group in groups if group]


def _radius(centers: Array, bound: Array, group: list[int]) -> float:
    """Mean over the sampled poses of the radius of the sphere about the group's mean that holds it."""
    inside = centers[:, group]
    between = inside - inside.mean(axis=1, keepdims=True)
    return float((np.sqrt((between * between).sum(axis=2)) + bound[group]).max(axis=1).mean())


def _sampled_centers(robot: Robot, rows: Volumes, link: Ints) -> Array:
    """Where the shapes are in random poses, (SAMPLES, S, 3)."""
    rng = np.random.default_rng(0)
    low, high = np.clip(robot.limits, -10.0, 10.0).T  # rad; some joints turn without end
    matrix, offset = robot.coupling
    angles = rng.uniform(low, high, (SAMPLES, len(low))) @ matrix.T + offset
    turn, shift = [np.broadcast_to(np.eye(3), (SAMPLES, 3, 3))], [np.zeros((SAMPLES, 3))]
    for j, joint in enumerate(robot.joints):
        carrier_turn, carrier_shift = turn[joint.parent], shift[joint.parent]
        if joint.kind == "prismatic":
            turn.append(carrier_turn)
            shift.append(carrier_shift + (carrier_turn @ joint.axis) * angles[:, j, None])
            continue
        u = joint.axis
        skew = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
        s, c = np.sin(angles[:, j, None, None]), 1.0 - np.cos(angles[:, j, None, None])
        own = np.eye(3) + s * skew + c * (skew @ skew)
        turn.append(carrier_turn @ own)
        shift.append((carrier_turn @ (joint.point - own @ joint.point)[:, :, None])[:, :, 0] + carrier_shift)
    turns, shifts = np.stack(turn, axis=1)[:, link], np.stack(shift, axis=1)[:, link]
    placed: Array = (turns @ rows["position"][:, :, None])[..., 0] + shifts
    return placed
