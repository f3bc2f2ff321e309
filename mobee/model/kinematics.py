# SPDX-License-Identifier: Apache-2.0
"""Forward kinematics, Jacobians and levers of contacts in NumPy, computed from the joint axes at zero pose; rotations and quaternions.

The functions take batches of poses, those for levers one pose. The lever of a contact is the change of its depth if the motors move by
1 rad; the factors on repulsive forces are computed from it. Quaternions are in the order w, x, y, z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array, Ints
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import LEVER, Joint, Robot, per_robot

_IDENTITY = np.eye(4)


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """The constants of a robot from which its forward kinematics is computed; n motors, J joints.

    At the angle or length a, the motion of a joint is the matrix (4, 4) I + sin(a) S + (1 - cos(a)) C + a D: Rodrigues' formula for a
    rotation about a line of the root frame. `sine`, `cosine` and `slide`, each (J, 4, 4), are the S, C and D of the joints; `slide` None:
    every joint is revolute. `coupling` (n, J), `offset` (J,): joint positions = q @ coupling + offset. `axes` (J, 3), `points` (J, 3) m:
    unit vector of each joint's axis, and a point on it, root frame, zero pose. `revolute`: (J,) 1 or 0. `ancestry`: for each link, the
    joints from the base to the link, in this order. `rounds`: the matrix products in their order (pointer jumping). Each round is two
    arrays of equal length, links and ancestors: the matrix of each link becomes (matrix of its ancestor) @ (matrix of the link).
    """

    coupling: Array  # (n, J), transposed: joint angles = q @ coupling + offset
    offset: Array
    sine: Array  # (J, 4, 4)
    cosine: Array  # (J, 4, 4)
    slide: Array | None  # (J, 4, 4), None when every joint is revolute
    rounds: tuple[tuple[Ints, Ints], ...]  # (links, ancestors) to join in each doubling round
    axes: Array
    points: Array
    revolute: Array
    ancestry: tuple[Ints, ...]


@per_robot
def tables(robot: Robot) -> Tables:
    """Return the constants of a robot from which its forward kinematics is computed; they are computed once for each robot."""
    count = len(robot.joints)
    sine, cosine, slide = (np.zeros((count, 4, 4)) for _ in range(3))
    for j, joint in enumerate(robot.joints):
        if joint.kind == "revolute":
            skew = _skew(joint.axis)
            for table, turn in ((sine, skew), (cosine, skew @ skew)):
                table[j, :3, :3] = turn
                table[j, :3, 3] = -turn @ joint.point
        else:
            slide[j, :3, 3] = joint.axis
    matrix, offset = robot.coupling
    return Tables(
        coupling=np.ascontiguousarray(matrix.T),
        offset=offset,
        sine=sine,
        cosine=cosine,
        slide=slide if slide.any() else None,
        rounds=_doubling_rounds(robot.joints),
        axes=np.array([joint.axis for joint in robot.joints]).reshape(-1, 3),
        points=np.array([joint.point for joint in robot.joints]).reshape(-1, 3),
        revolute=np.array([float(joint.kind == "revolute") for joint in robot.joints]),
        ancestry=_ancestry(robot.joints),
    )


def _skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _ancestry(joints: tuple[Joint, ...]) -> tuple[Ints, ...]:
    chains = [np.empty(0, dtype=np.intp)]
    for link in range(1, len(joints) + 1):
        chain = []
        while link > 0:
            chain.append(link - 1)
            link = joints[link - 1].parent
        chains.append(np.array(chain[::-1], dtype=np.intp))
    return tuple(chains)


def _doubling_rounds(joints: tuple[Joint, ...]) -> tuple[tuple[Ints, Ints], ...]:
    """Return, for each round of the computation of link transforms, the links and the ancestors of these links, two arrays of indices.

    In a round, the matrix of each link is multiplied by that of its ancestor (pointer jumping). After round r it covers the last 2^r joints
    of the link's chain, so the number of rounds is about log2 of the longest chain.
    """
    ancestor = np.array([0, *(joint.parent for joint in joints)], dtype=np.intp)
    rounds = []
    while ancestor.any():
        links = np.flatnonzero(ancestor)
        rounds.append((links, ancestor[links]))
        ancestor = ancestor[ancestor]
    return tuple(rounds)


def cross(a: Array, b: Array) -> Array:
    """Return the cross products of a and b over the last dimension, (..., 3); faster than np.cross for a few rows."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out


def link_transforms(robot: Robot, q: Array) -> Array:
    """Return the transform of every link, which maps the position of a point at zero pose to its position at q, both in the root frame.

    `q`: (..., n) motor positions in rad.  Returns (..., L, 4, 4) with L = len(robot.links); link 0 is the base.
    """
    t = tables(robot)
    angles = (q @ t.coupling + t.offset)[..., None, None]
    motion = np.empty((*q.shape[:-1], len(robot.links), 4, 4))
    motion[..., 0, :, :] = _IDENTITY
    moved = np.sin(angles) * t.sine
    moved += (1.0 - np.cos(angles)) * t.cosine
    if t.slide is not None:
        moved += angles * t.slide
    np.add(moved, _IDENTITY, out=motion[..., 1:, :, :])
    for links, ancestors in t.rounds:
        motion[..., links, :, :] = motion[..., ancestors, :, :] @ motion[..., links, :, :]
    return motion


def joint_axes(robot: Robot, transforms: Array) -> tuple[Array, Array]:
    """Return the axis (unit vector) and a point on the axis [m] of each joint in a pose, root frame: two arrays (..., J, 3).

    `transforms`: (..., L, 4, 4) of all links in this pose, as from `link_transforms`.
    """
    return _moved_axes(robot, transforms, np.arange(len(robot.joints)))


def point_jacobian(robot: Robot, transforms: Array, link: int, point: Array) -> Array:
    """Return the Jacobian of a point that is fixed to a link (thesis eq. 5.1), (..., 6, n), with a column for each motor.

    The first three rows are for velocity [m/rad], the last three for angular velocity, root frame. `transforms`: (..., L, 4, 4) of all
    links in this pose, as from `link_transforms`. `link`: index of the link. `point`: (..., 3) m, root frame, in this pose.
    """
    t = tables(robot)
    chain = t.ancestry[link]
    axes, points = _moved_axes(robot, transforms, chain)
    revolute = t.revolute[chain, None]
    arms = point[..., None, :] - points
    per_joint = np.empty((*axes.shape[:-1], 6))
    per_joint[..., :3] = revolute * cross(axes, arms) + (1.0 - revolute) * axes
    per_joint[..., 3:] = revolute * axes
    return np.swapaxes(per_joint, -1, -2) @ t.coupling[:, chain].T


def _moved_axes(robot: Robot, transforms: Array, joints: Ints) -> tuple[Array, Array]:
    # A joint leaves its own axis where it is, so the link it moves carries the axis too.
    t = tables(robot)
    moved = transforms[..., joints + 1, :3, :]
    axes = (moved[..., :3] @ t.axes[joints, :, None])[..., 0]
    points = (moved[..., :3] @ t.points[joints, :, None])[..., 0] + moved[..., 3]
    return axes, points


def lever(robot: Robot, transforms: Array, links: tuple[int, int], point: Array, normal: Array) -> float:
    """Return the lever of a contact of two links [m/rad]: the norm of the derivatives of its depth with respect to the motor positions.

    A joint that moves both links does not count. For a motor that slides, the derivative [m/m] is multiplied by the length [m] that the
    control law treats as 1 rad (`mobee.robot.motor_units.motor_units`). `transforms`: (L, 4, 4) of all links. `links`: indices; below 0: a
    free object (an object of the world that is on no link). `point` (3,) m and `normal` (3,) of the contact: root frame, in this pose.
    """
    change = np.zeros(len(robot.motors))
    for link, sign in zip(links, (1.0, -1.0), strict=True):
        if link > 0:
            change += sign * (normal @ point_jacobian(robot, transforms, link, point)[:3])
    return float(np.linalg.norm(change * motor_units(robot)))


def push_factors(robot: Robot, transforms: Array, links: Ints, depths: Array, points: Array, normals: Array) -> Array:
    """Return the factors (c,) that multiply the repulsive pushes, depth * normal, of c contacts of fields.

    Fields are volumes that cause repulsive forces. The factors are 1 if `robot.least_lever` is 0. Otherwise a factor is larger if the lever
    of the contact is shorter (`lever`: the norm of the derivatives of its depth with respect to the motors): it is LEVER^2 / (lever^2 +
    least_lever^2) * depth / total, with LEVER = 0.5 m; total is the sum of the depths of all contacts between the same two links. This is
    our extension of thesis eq. 5.11 (docs/law.md). `transforms`: (L, 4, 4) of all links. `links` (c, 2): indices; all free objects (-1,
    objects of the world that are on no link) count as one link. `depths` (c,) m, `points` (c, 3) m, `normals` (c, 3): of the contacts, root
    frame.
    """
    factors = np.ones(len(depths))
    if robot.least_lever <= 0.0:
        return factors
    pairs = [tuple(sorted(pair)) for pair in links.tolist()]
    for k, (pair, point, normal) in enumerate(zip(links.tolist(), points, normals, strict=True)):
        together = sum(depth for depth, other in zip(depths.tolist(), pairs, strict=True) if other == pairs[k])
        squares = lever(robot, transforms, (pair[0], pair[1]), point, normal) ** 2 + robot.least_lever**2
        factors[k] = depths[k] / together * LEVER**2 / squares
    return factors


def quaternion_from_matrix(rotation: Array) -> Array:
    """Return unit quaternions wxyz (..., 4), w >= 0, of rotation matrices (..., 3, 3)."""
    r = rotation
    trace = np.trace(r, axis1=-2, axis2=-1)
    # Outer product of the quaternion with itself, times 4; its largest column divides without loss (Shepperd 1978).
    outer = np.empty((*r.shape[:-2], 4, 4))
    outer[..., 0, 0] = 1.0 + trace
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        outer[..., i + 1, i + 1] = 1.0 + 2.0 * r[..., i, i] - trace
        outer[..., 0, i + 1] = outer[..., i + 1, 0] = r[..., k, j] - r[..., j, k]
        outer[..., j + 1, k + 1] = outer[..., k + 1, j + 1] = r[..., j, k] + r[..., k, j]
    best = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(outer, best[..., None, None], axis=-1)[..., 0]
    q /= np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0.0, -q, q)


def matrix_from_quaternion(quaternion: Array) -> Array:
    """Return rotation matrices (..., 3, 3) of quaternions wxyz (..., 4), which are normalised first."""
    q = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
