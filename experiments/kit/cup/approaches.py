# SPDX-License-Identifier: Apache-2.0
"""Common code of the trials of the cup experiment: robot, pre-grasp map and start posture, and a planner that uses RRT-Connect.

The pre-grasp map is a roadmap of postures in which the hand is beside a possible place of the cup.
"""

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
    """Return the iCub; every call returns the same object."""
    return mobee.load_robot("icub")


def side_grasp(model: Model) -> SideGrasp:
    """Return the object that computes postures for grasps from the side with the right hand.

    `model`: the robot in the world that it must not touch.
    """
    return SideGrasp(model, MARKER, MOTORS, icub_starts(robot()))


@cache
def roadmap() -> Roadmap:
    """Return the pre-grasp map, a roadmap of poses beside possible places of the cup, made for the empty table."""
    return pre_grasp_map(side_grasp(Model(robot(), table())), TOP)


def ready() -> Array:
    """Return the posture (n,) rad in which a trial begins: the right hand is at the side of the table."""
    return aside(roadmap(), TOP, side_grasp(roadmap().model).grip)


def roomy_placement(seed: int) -> Placement:
    """Draw placements of cup and clutter with a seed, and return the first one in which the hand fits beside the cup from some direction.

    The start posture must also be without contacts.  All clutter counts, even what the cameras do not see.
    """
    rng = np.random.default_rng([seed, 433])
    while True:
        scene, world = placement(rng), table()
        for name, piece in scene.clutter.items():
            world.add(name, piece.shape, position=standing(piece.place, piece.height))
        grasp = side_grasp(Model(robot(), world))
        if not grasp.model.evaluate(ready()).count and pre_grasps(grasp, Upright(scene.cup, RADIUS, HEIGHT, TOP)):
            return scene


class RrtPlanner:
    """A `mobee.behaviours.pre_grasp.Planner` that uses OMPL's RRT-Connect and shortens the paths.

    `world`: the robot in the world in which it plans.  `seed`: seed of the random paths.
    """

    def __init__(self, world: Model, seed: int) -> None:
        self._world, self._rng = world, np.random.default_rng([seed, 435])

    def path(self, start: Array, goal: Array, azimuth: float, blocked: Array) -> Array | None:
        """Return a path (K, n) rad from the posture `start` (n,) to the pre-grasp `goal` (n,), or None if no path was found.

        `azimuth` is not used.  `blocked`: (B, 3) m, root frame, positions of the palm where the arm bumped into something before.  If there
        are such positions, up to 10 random paths are planned, and the first on which the palm moves around or over them is returned.  If
        there are none, one path is planned and shortened.
        """
        for _ in range(TRIES if len(blocked) else 1):
            path = rrt_connect(self._world, start, goal, MOTORS, int(self._rng.integers(2**31)))
            if path is None:
                return None
            path = shortened(self._world, path, self._rng) if not len(blocked) else path
            if is_around(self._world, MARKER, path, blocked):
                return path
        return None


def shortened(world: Model, path: Array, rng: np.random.Generator) -> Array:
    """Return the path (K, n) rad with fewer corners.

    Two corners are chosen at random, many times.  If the straight motion between them is without contacts of solids, the corners between
    them are removed.  `world`: the robot in the world that it must not touch.
    """
    corners = list(path)
    for _ in range(SHORTCUTS):
        if len(corners) < 3:
            break
        first, last = sorted(rng.choice(len(corners), 2, replace=False).tolist())
        if last - first > 1 and is_free(world, np.stack([corners[first], corners[last]])):
            corners[first + 1 : last] = []
    return np.array(corners)
