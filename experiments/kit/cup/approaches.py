# SPDX-License-Identifier: Apache-2.0
"""What the trials of the cup experiment share: robot, pre-grasp map and start, and the planner peer with RRT-Connect."""

from __future__ import annotations

from functools import cache

import numpy as np

import mobee
from experiments.kit.cup.scene import HEIGHT, RADIUS, TOP, Placement, placement, standing, table
from mobee import Model
from mobee.arrays import Array
from mobee.behaviours.grasp import SideGrasp
from mobee.behaviours.pick import Upright, is_free, pre_grasps
from mobee.behaviours.pre_grasp import MARKER, MOTORS, aside, icub_starts, is_around, pre_grasp_map
from mobee.roadmap.ompl import rrt_connect
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Robot

SHORTCUTS = 60
TRIES = 10  # paths, to find one around what was bumped into


@cache
def robot() -> Robot:
    """Return the robot."""
    return mobee.load_robot("icub")


def side_grasp(model: Model) -> SideGrasp:
    """Return the grasp of the right hand in a world."""
    return SideGrasp(model, MARKER, MOTORS, icub_starts(robot()))


@cache
def roadmap() -> Roadmap:
    """Return the pre-grasp map over the empty table."""
    return pre_grasp_map(side_grasp(Model(robot(), table())), TOP)


def ready() -> Array:
    """Return the posture in which a trial begins, (n,) rad: the hand is at the side of the table."""
    return aside(roadmap(), TOP, side_grasp(roadmap().model).grip)


def roomy_placement(seed: int) -> Placement:
    """Draw placements until there is one with room for the hand beside the cup, in some direction and among all clutter."""
    rng = np.random.default_rng([seed, 433])
    while True:
        scene, world = placement(rng), table()
        for name, piece in scene.clutter.items():
            world.add(name, piece.shape, position=standing(piece.place, piece.height))
        grasp = side_grasp(Model(robot(), world))
        if not grasp.model.evaluate(ready()).count and pre_grasps(grasp, Upright(scene.cup, RADIUS, HEIGHT, TOP)):
            return scene


class RrtPlanner:
    """Calls OMPL's RRT-Connect in a world, and shortens its paths."""

    def __init__(self, world: Model, seed: int) -> None:
        self._world, self._rng = world, np.random.default_rng([seed, 435])

    def path(self, start: Array, goal: Array, azimuth: float, blocked: Array) -> Array | None:
        """See Planner; a path that passes a blocked place is drawn again, a few times."""
        for _ in range(TRIES if len(blocked) else 1):
            path = rrt_connect(self._world, start, goal, MOTORS, int(self._rng.integers(2**31)))
            if path is None:
                return None
            path = shortened(self._world, path, self._rng) if not len(blocked) else path
            if is_around(self._world, MARKER, path, blocked):
                return path
        return None


def shortened(world: Model, path: Array, rng: np.random.Generator) -> Array:
    """Return a path (K, n) rad with shortcuts between random corners where they are free."""
    corners = list(path)
    for _ in range(SHORTCUTS):
        if len(corners) < 3:
            break
        first, last = sorted(rng.choice(len(corners), 2, replace=False).tolist())
        if last - first > 1 and is_free(world, np.stack([corners[first], corners[last]])):
            corners[first + 1 : last] = []
    return np.array(corners)
