"""Forward kinematics: product of exponentials over the tree (Gupta's zero reference position, thesis 2.3.1)."""

from __future__ import annotations

import numpy as np

from mobee.kinematics.tables import tables
from mobee.robot.robot import Array, Robot

_IDENTITY = np.eye(4)


def link_transforms(robot: Robot, q: Array) -> Array:
    """Where every link has gone: maps a point of the root frame at zero pose to where it is at q.

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
