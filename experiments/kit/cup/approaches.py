# SPDX-License-Identifier: Apache-2.0
"""The cup experiment: random scenes with a cup and clutter, what the robot sees of them, and motions to the pre-grasp beside the cup.

The motions are made by a planner with RRT-Connect, by the pre-grasp map (a roadmap of postures in which the hand is beside a possible place
of the cup), and by an agent that learns on an offline plant (a robot simulated in one process) to bring the palm beside a cup.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

import mobee
from experiments.kit.plants import PhysicsPlant
from mobee import Geometry, Lattice, Model, OfflinePlant, ReachAgent, ReachTarget, World, box, cylinder
from mobee.arrays import Array
from mobee.behaviours.grasp import Grip, SideGrasp, palm_beside
from mobee.behaviours.pick import Upright, azimuth_beside, is_free, pre_grasps
from mobee.behaviours.pre_grasp import MARKER, MOTORS, PART, Approach, aside, icub_starts, is_around, pre_grasp_map
from mobee.roadmap import playback
from mobee.roadmap.ompl import rrt_connect
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Robot

CUP = "cup"
TOP = -0.1  # m, of the table
RADIUS, HEIGHT = 0.028, 0.13  # m, of the cup: thumb and fingers of the iCub enclose it
MASS, FRICTION = 0.15, 0.8  # kg, and coefficient
CLUTTER_MASS, CLUTTER_FRICTION = 0.3, 0.6
NEAREST, FARTHEST = np.array([-0.42, -0.05]), np.array([-0.27, 0.2])  # m, of the cup's places
CORNER, END = np.array([-0.55, -0.2]), np.array([-0.2, 0.28])  # m, of the clutter's
APART = 0.12, 0.09  # m, of clutter from the cup, and from other clutter
MOST = 3  # pieces of clutter
SEEN = 0.002  # m, standard deviation of a seen place along each axis, of calibrated cameras (docs/vision.md)
INFLATED = 0.005  # m, by which things are enlarged when motions are planned
COLOR = (0.05, 0.3, 0.85)
FALLEN = np.deg2rad(25.0)  # a thing that leans more was knocked over
_COLORS = ((0.1, 0.6, 0.15), (0.85, 0.7, 0.1), (0.6, 0.6, 0.65))
SHORTCUTS = 60
TRIES = 10  # paths, to find one around what was bumped into
JOINTS = ("r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow")
LEVELS = (0.15, 0.4, 0.65)  # of the ranges
PROBLEMS, LEARNED_TRIES = 40, 300
SMALL = 0.01  # m, radius of the target, which stands for the place of the palm


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """A piece of clutter that stands on the table.

    `place`: (2,) m, root frame, x and y of its centre.  `height`: m.  `seen`: whether the cameras see it.
    """

    shape: Geometry
    place: Array
    height: float
    seen: bool


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """A scene: the place of the cup, (2,) m in the root frame (x and y), and the pieces of clutter by name."""

    cup: Array
    clutter: Mapping[str, Piece]


def placement(rng: np.random.Generator) -> Placement:
    """Draw a cup and 0 to 3 pieces of clutter at random places; if there is clutter, the cameras do not see the first piece."""
    cup, count = rng.uniform(NEAREST, FARTHEST), int(rng.integers(MOST + 1))
    found: dict[str, Piece] = {}
    while len(found) < count:
        place, kind = rng.uniform(CORNER, END), int(rng.integers(2))
        width, height = rng.uniform(0.05, 0.07), rng.uniform(0.06, 0.1)
        others = [piece.place for piece in found.values()]
        if np.linalg.norm(place - cup) < APART[0] or any(np.linalg.norm(place - other) < APART[1] for other in others):
            continue
        shape = box(width, width, height) if kind else cylinder(0.5 * width, height)
        found[f"clutter {len(found)}"] = Piece(shape, place, height, seen=bool(found))
    return Placement(cup, found)


def true_world(scene: Placement) -> World:
    """Return the world of the physics: table, cup and all clutter; cup and clutter move when they are pushed."""
    world = table()
    world.add(CUP, cylinder(RADIUS, HEIGHT), position=standing(scene.cup, HEIGHT), role="target", color=COLOR, mass=MASS, friction=FRICTION)
    for number, (name, piece) in enumerate(scene.clutter.items()):
        at = standing(piece.place, piece.height)
        world.add(name, piece.shape, position=at, role="target", color=_COLORS[number], mass=CLUTTER_MASS, friction=CLUTTER_FRICTION)
    return world


def table() -> World:
    """Return a new world with only the table."""
    world = mobee.load_world("table")
    world.remove("ball")
    return world


def standing(place: Array, height: float) -> Array:
    """Return the position (3,) m of the centre of a thing that stands on the table; `place`: (2,) m, x and y; `height`: of the thing, m."""
    return np.array([*place, TOP + 0.5 * height])


class Eyes:
    """What the cameras see of a scene: the places of the cup and of the visible clutter, with random errors of 2 mm along x and y."""

    def __init__(self, scene: Placement, seed: int) -> None:
        self._rng, self._scene = np.random.default_rng([seed, 434]), scene

    def cup(self, place: Array) -> Upright:
        """Return the cup as the cameras see it, with a new random error, when its true place is `place` (2,) m."""
        return Upright(place + SEEN * self._rng.standard_normal(2), RADIUS, HEIGHT, TOP)

    def show(self, world: World, cup: Upright, margin: float) -> None:
        """Add the cup, and the clutter that the cameras see, to a world.

        Each of these objects is enlarged by `margin` [m] on all sides, and has the role "target": it repels all links except a hand that
        reaches for it.  `cup`: the cup as `Eyes.cup` returns it.  The places of the clutter get new random errors.
        """
        world.add(CUP, cylinder(RADIUS, HEIGHT).grown(margin), position=standing(cup.place, HEIGHT), role="target")
        for name, piece in self._scene.clutter.items():
            if piece.seen:
                at = piece.place + SEEN * self._rng.standard_normal(2)
                world.add(name, piece.shape.grown(margin), position=standing(at, piece.height), role="target")


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
        are such positions, up to 10 random paths are planned, and the first on which the palm moves around or over them is returned; None
        if no path does.  If there are none, one path is planned and shortened.
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


@cache
def learner() -> ReachAgent:
    """Return the agent, which has learned to reach beside cups at random places of an empty table.

    The agent's states are postures on a lattice of four arm joints.  Only these joints move; torso, wrist and hand stay in the posture in
    which a trial begins.  Every call returns the same object.
    """
    body = playback.standing(robot(), ready())
    where = body.part(PART).slice
    low, high = body.limits[where].T
    space = Lattice(body, JOINTS, LEVELS, 16, rest=(ready()[where] - low) / (high - low))
    plant = OfflinePlant(Model(body, table()), 0, active=[PART])
    found = ReachAgent(space, plant, marker=MARKER, predictor="gp", strategy="ucb", failures="alike", seed=0)
    rng = np.random.default_rng([0, 436])
    found.learn([_target(Upright(place, RADIUS, HEIGHT, TOP)) for place in rng.uniform(NEAREST, FARTHEST, (PROBLEMS, 2))], LEARNED_TRIES)
    return found


def by_learner(plant: PhysicsPlant, thing: Upright) -> Approach:
    """Bring the palm beside the cup `thing` by a plan of the agent that `learner` returns, and return the result as `Approach`.

    The result always has 1 plan, and 0 bumps (unplanned contacts of the arm), because bumps are not detected here.  The arm moves through
    the states of the agent's plan; then a reach follows, in which a force pulls the palm to its place beside the cup.  The agent learns
    nothing from this.  The returned azimuth, the direction that the palm faces, is the planned one, even if the palm did not arrive.
    """
    agent, target = learner(), _target(thing)
    begun = time.process_time()
    state = agent.space.state_of(plant.measure(PART))
    planned = agent.plan(target, state)
    planning = time.process_time() - begun
    plant.exempt = None
    plant.present(target)
    for passed in planned.path[1:]:
        plant.act(PART, agent.space.target(passed))
    plant.reach(PART, MARKER, stay=True)
    plant.present(None)
    plant.exempt = MARKER
    return Approach(azimuth_beside(thing.place), 0, 1, planning)


def _target(thing: Upright) -> ReachTarget:
    """Return the reach that brings the palm to its place beside the thing, facing it."""
    azimuth, grip = azimuth_beside(thing.place), Grip()
    palm = palm_beside(thing.place, thing.radius, azimuth, grip.before, thing.ground, grip)
    return ReachTarget(palm.position, SMALL, "centre", palm.rotation[:, 2])
