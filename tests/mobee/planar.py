# SPDX-License-Identifier: Apache-2.0
"""Small robots made by hand: a planar arm whose geometry one can do in the head, and a tree that uses everything."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Joint, Marker, Motor, Part, Robot, Shape

LENGTH = 0.3  # m, of each segment
RADIUS = 0.05  # m, of its solid capsule
FIELD = 0.12  # m, of the field around its tip


def planar_arm() -> Robot:
    """Three revolute joints about z, stretched along x at zero: tip at (0.9, 0, 0).  Link 0 is a post under the first joint."""
    z = np.array([0.0, 0.0, 1.0])
    joints = tuple(Joint(f"j{i}", i, "revolute", z, np.array([i * LENGTH, 0.0, 0.0]), np.array([-3.0, 3.0])) for i in range(3))
    motors = tuple(Motor(f"m{i}", "arm", np.array([-3.0, 3.0]), 0.0, ((i, 1.0, 0.0),)) for i in range(3))
    along_x = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    shapes = [Shape("post", 0, "box", (0.1, 0.1, 0.1), np.array([0.0, 0.0, -0.2]), np.eye(3), "solid", "arm")]
    for i in range(3):
        middle, end = np.array([(i + 0.5) * LENGTH, 0.0, 0.0]), np.array([(i + 1) * LENGTH, 0.0, 0.0])
        shapes.append(Shape(f"segment{i}", i + 1, "capsule", (RADIUS, LENGTH), middle, along_x, "solid", "arm"))
        shapes.append(Shape(f"field{i}", i + 1, "sphere", (FIELD,), end, np.eye(3), "field", "arm"))
    markers = {"tip": Marker("tip", 3, np.array([3 * LENGTH, 0.0, 0.0]), np.eye(3), np.array([1.0, 0.0, 0.0]))}
    return Robot(
        name="planar",
        links=("base", "link1", "link2", "link3"),
        joints=joints,
        motor_table=motors,
        parts={"arm": Part("arm", ("m0", "m1", "m2"), 0)},
        markers=markers,
        shapes=tuple(shapes),
        clauses=(),
        field_pairs=np.array([[2, 6]]),
        solid_pairs=np.array([[1, 5], [0, 5]]),
        base_shapes=frozenset({0}),
    )


def tree(seed: int, joints: int = 12) -> Robot:
    """A random branching tree with revolute and prismatic joints, two of them driven by one motor and one by two motors."""
    rng = np.random.default_rng(seed)
    made = []
    for j in range(joints):
        axis = rng.normal(size=3)
        kind = "prismatic" if j % 5 == 4 else "revolute"
        made.append(
            Joint(f"j{j}", int(rng.integers(0, j + 1)), kind, axis / np.linalg.norm(axis), rng.uniform(-1, 1, 3), np.array([-3.0, 3.0]))
        )
    drives = [[(j, 1.0, 0.0)] for j in range(joints - 1)]
    drives[0].append((joints - 1, -0.5, 0.3))
    drives[1].append((2, 0.5, 0.0))
    motors = tuple(Motor(f"m{i}", "body", np.array([-3.0, 3.0]), 0.0, tuple(drive)) for i, drive in enumerate(drives))
    markers = {
        f"marker{link}": Marker(f"marker{link}", link, rng.uniform(-1, 1, 3), np.eye(3), np.array([0.0, 0.0, 1.0]))
        for link in range(joints + 1)
    }
    return Robot(
        name=f"tree{seed}",
        links=("base", *(f"link{j}" for j in range(joints))),
        joints=tuple(made),
        motor_table=motors,
        parts={"body": Part("body", tuple(m.name for m in motors), 0)},
        markers=markers,
        shapes=(),
        clauses=(),
        field_pairs=np.empty((0, 2), dtype=np.intp),
        solid_pairs=np.empty((0, 2), dtype=np.intp),
    )
