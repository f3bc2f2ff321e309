"""The tag convex: the hull of points, for what no primitive volume fits."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array
from mobee.robot.xml_node import Node
from mobee.robot.xml_volume import AXIS, PLACE, Volume, box_rotation

CONVEX_ATTRIBUTES = frozenset({"points", "angle", *PLACE, *AXIS})
MOST_POINTS = 10_000
FLAT = 1e-6  # a hull thinner than this part of its length has no inside that a collision test could find


def read_convex(node: Node) -> Volume:
    """The volume of a <convex>: `points` (x y z each, in m) about its centre, turned like a box; raises RobotFileError."""
    numbers = node.numbers("points")
    if len(numbers) % 3 or not 4 <= len(numbers) // 3 <= MOST_POINTS:
        node.fail("points", f"has {len(numbers)} numbers", f"Write x y z of 4 to {MOST_POINTS} points, separated by blanks")
    vertices: Array = np.array(numbers).reshape(-1, 3)
    extent = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if extent[2] <= max(FLAT * extent[0], 1e-9):
        node.fail("points", "all lie in one plane", "Give the hull a thickness, or write a thin <box>")
    return Volume("convex", (), node.vector(PLACE), box_rotation(node), vertices)
