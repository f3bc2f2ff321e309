"""Whether an arm is at the table, by geometry alone: it is asked of tables that exert forces and of ghosts alike."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_learning import LEFT, RANK3, RIGHT, TORSO, arm_space, robot, table_world
from mobee import Model, World, box
from mobee.collision.touch import links_moved
from mobee.robot.robot import Array

NEAR = 0.02  # m between a field and the table's surface (paper, fig. 8: hand or elbow "within 2 cm of the table")
BATCH = 2000  # poses
FORWARD = np.deg2rad(30.0)  # of torso pitch

JOINTS = {"left_arm": LEFT, "right_arm": RIGHT}


def world_around(margin: float) -> World:
    """The table, larger by a margin [m] on every side."""
    table = table_world().objects["table"]
    larger = World()
    size = [edge + 2.0 * margin for edge in table.size]
    larger.add("table", box(*size), position=table.position, rotation=table.rotation)
    return larger


def near_table(q: Array, arm: str, margin: float = NEAR) -> NDArray[np.bool_]:
    """In which poses q (N, n) rad a field of the arm is nearer to the table than the margin [m], (N,)."""
    model, moved = Model(robot(), world_around(margin)), np.array(sorted(links_moved(robot())[arm]))
    near = np.zeros(len(q), dtype=bool)
    for first in range(0, len(q), BATCH):
        table = model.evaluate(q[first : first + BATCH]).table
        rows = (table.second_link < 0) & (table.kind == 1) & np.isin(table.first_link, moved)
        near[first + table.pose[rows]] = True
    return near


def low_goals(arm: str) -> NDArray[np.bool_]:
    """Which states (81,) of an arm lie below the table's top when the torso is bent forward (75 % of its range)."""
    space, pitch = arm_space(joints=JOINTS[arm]), robot().motor_index(TORSO[2])
    q = np.tile(robot().home, (len(space), 1))
    low, high = robot().limits[pitch]
    q[:, pitch] = low + RANK3[-1] * (high - low)
    q[:, robot().part(arm).slice] = [space.target(state) for state in range(len(space))]
    return near_table(q, arm, 0.0)


def is_forward(q: Array) -> NDArray[np.bool_]:
    """In which poses q (N, n) rad the torso is bent forward, (N,)."""
    bent: NDArray[np.bool_] = q[:, robot().motor_index(TORSO[2])] > FORWARD
    return bent
