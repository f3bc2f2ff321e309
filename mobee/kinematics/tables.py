"""What forward kinematics and Jacobians need of a robot, computed once and kept as long as the robot lives."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Array, Ints, Joint, Robot


@dataclass(frozen=True, slots=True, eq=False)
class Tables:
    """A joint's motion is I + sin(a) S + (1 - cos(a)) C + a D: Rodrigues' formula about a line of the root frame."""

    coupling: Array  # (n, J), transposed: joint angles = q @ coupling + offset
    offset: Array  # (J,)
    sine: Array  # (J, 4, 4)
    cosine: Array  # (J, 4, 4)
    slide: Array | None  # (J, 4, 4), None when every joint is revolute
    rounds: tuple[tuple[Ints, Ints], ...]  # (links, ancestors) to join in each doubling round
    axes: Array  # (J, 3) at zero pose
    points: Array  # (J, 3) m at zero pose
    revolute: Array  # (J,) 1 or 0
    ancestry: tuple[Ints, ...]  # for each link, the joints between it and the base


@per_robot
def tables(robot: Robot) -> Tables:
    """The tables of this robot object."""
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
    """Pointer jumping: after round r a link's matrix spans its last 2^r joints, so the deepest chain takes log2 rounds."""
    ancestor = np.array([0, *(joint.parent for joint in joints)], dtype=np.intp)
    rounds = []
    while ancestor.any():
        links = np.flatnonzero(ancestor)
        rounds.append((links, ancestor[links]))
        ancestor = ancestor[ancestor]
    return tuple(rounds)
