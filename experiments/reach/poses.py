"""The poses that reaches begin at most often, with the targets (thesis fig. 8.3)."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.reach.runs import Runs
from experiments.reaching.scene import MARKER, PART, reach_space
from experiments.reaching.targets import grid
from mobee import Model
from mobee.robot.robot import Array

COUNT = 4
SIDES = 12  # of a circle


def draw_poses(drawing: Any, mine: Runs) -> None:
    """The favourites at the last look, by how often they were chosen."""
    share = mine.chosen(mine.looks[-1]).mean(axis=0)
    for place, state in enumerate(np.argsort(-share)[:COUNT].tolist(), 1):
        axes = drawing.add_subplot(1, COUNT, place, projection="3d")
        _pose(axes, state)
        axes.set_title(f"state {state}: {100.0 * share[state]:.0f} % of the reaches", fontsize=9)


def _pose(axes: Any, state: int) -> None:
    """Solids of body and right arm as skeletons, the palm, the targets as dots; seen from the front and the robot's right."""
    space = reach_space()
    robot = space.robot
    q = robot.home.copy()
    q[robot.part(PART).slice] = space.target(state)
    pose = Model(robot).evaluate(q)
    for shape in robot.shapes:
        if shape.role == "solid" and shape.part in (PART, "torso", "head"):
            ends = _axis(shape.position, shape.rotation, shape.size[-1] if len(shape.size) > 1 else 0.0)
            placed = ends @ pose.transforms[shape.link][:3, :3].T + pose.transforms[shape.link][:3, 3]
            width = 200.0 * shape.size[0] if shape.kind in ("sphere", "capsule", "cylinder") else 2.0
            axes.plot(
                *placed.T, color="tab:red" if shape.part == PART else "0.6", linewidth=min(width, 14.0), alpha=0.5, solid_capstyle="round"
            )
    axes.plot(*pose.position(MARKER), "k*", markersize=10.0)
    axes.plot(*grid().T, "o", color="tab:green", markersize=5.0, alpha=0.6)
    axes.set(xlabel="x", ylabel="y", zlabel="z", xlim=(-0.45, 0.25), ylim=(-0.2, 0.5), zlim=(-0.15, 0.55))
    axes.view_init(20.0, 145.0)
    axes.set(xticks=(-0.4, -0.2, 0.0, 0.2), yticks=(-0.2, 0.0, 0.2, 0.4), zticks=(0.0, 0.2, 0.4))
    axes.tick_params(labelsize=7, pad=0)
    axes.set_box_aspect(None, zoom=0.85)  # so that the label of z is in the picture


def _axis(position: Array, rotation: Array, length: float) -> Array:
    """The two ends of a shape's axis, (2, 3) m."""
    along = 0.5 * length * rotation[:, 2]
    return np.array([position - along, position + along])
