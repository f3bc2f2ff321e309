# SPDX-License-Identifier: Apache-2.0
"""The arm of the live robot and its problems: robot, control law, states, targets, first poses, and the learner that is trained offline.

A problem is a target to be reached from a random first pose.  The targets are the thesis' 27 and new ones between them.  In most problems
nothing moves; in the others the target moves, or an obstacle.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from msgspec import Struct, structs

from experiments.kit.live.launch import TABLE
from experiments.kit.reaching.arm import MARKER, PART
from experiments.kit.reaching.belief import PeerBelief, approach
from experiments.kit.reaching.learning import LEARNERS
from experiments.kit.reaching.targets import grid
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, World, load_robot, load_world
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.learning.record import load_learned
from mobee.reach import Aim, ReachPlant, ReachTarget
from mobee.robot.robot import Robot
from mobee.store import TransitionStore

ROBOT, GAINS, RATE = "icub", "default", 50  # Hz
JOINTS, WRIST = 4, 7  # joints of the lattice; of a reach, and of the planner
LEVELS, NEIGHBOURS = (0.25, 0.5, 0.75), 16
LEARNER = "gp-ucb-alike"
SUCCESS_DISTANCE = 0.02  # m from the target's surface
MIN_DEPTH = 2e-3  # m, of a solid contact
REACHES = 3  # per try, each from another state
MIN_STATE_DISTANCE = (
    0.25  # of the ranges, one step of the lattice: states at most this far from one that missed are not used again in a try
)
AIM: Aim = "surface"
TRANSITIONS = 3000  # curious transitions before the first target (thesis 7.2.2: 2987)
POSES = 256  # first poses of inverse kinematics
IK_MARGIN = 5e-3  # m, margin of inverse kinematics
DRAWS = 1000  # of a target or a first pose
AWAY = ReachTarget(np.array([0.0, 0.0, 10.0]))
GRID, FRESH, TARGET_MOVES, OBSTACLE_MOVES = "grid", "fresh", "target moves", "obstacle moves"
SPEED = 0.03  # m/s, of a moving target or obstacle
MOVED_DISTANCE = 0.15  # m that a target moves, and an obstacle to either side
OBSTACLE, CLEAR = 0.04, 0.05  # m, radius of the obstacle, and distance of its surface from that of the target
SPARE = 6  # new targets that are drawn per moving problem
PATHS = 8  # of an obstacle, that are drawn


@cache
def robot() -> Robot:
    """Return the robot of the live system, `icub`."""
    return load_robot(ROBOT)


def world(path: Path = TABLE) -> World:
    """Return the world in the file `path`, by default that with the iCub's table and nothing on it."""
    return load_world(str(path))


@cache
def space() -> Lattice:
    """Return the lattice of 81 states of the right arm's four joints of shoulder and elbow, with 16 neighbours each."""
    return Lattice(robot(), robot().parts[PART].motors[:JOINTS], LEVELS, NEIGHBOURS)


def offline_plant(seed: int) -> OfflinePlant:
    """Return an offline plant of the right arm with its wrist (seven motors) at the table.

    `seed`: of the plant.  The motor parameters are those that were identified on PyBullet's robot.
    """
    motors = MotorParameters.identified(ROBOT)
    return OfflinePlant(Model(robot(), world()), seed, Gains.named(GAINS), motors, 1.0 / RATE, active=robot().parts[PART].motors[:WRIST])


def belief() -> PeerBelief:
    """Return the planner's model: the same robot, table, cable constraints and gains as in MoBeE's model."""
    clauses = [clause for clause in robot().clauses if clause.part == PART]
    return PeerBelief(Model(robot(), world()), robot().parts[PART].motors[:WRIST], MARKER, clauses, Gains.named(GAINS))


class Problem(Struct, frozen=True):
    """A target that is to be reached, and the posture of the arm in which the try begins.

    `kind`: "grid" (a target of the thesis), "fresh" (a new one), "target moves" or "obstacle moves".  `number`: of the problem among those
    of its kind.  `position`: of the target's centre, m, root frame.  `start`: first posture of the part, (n_part,) rad.
    """

    kind: str
    number: int
    position: list[float]
    start: list[float]
    path: list[list[float]] | None = None
    """The two positions, m, root frame, between which the target or an obstacle moves back and forth; None: nothing moves."""

    @property
    def target(self) -> ReachTarget:
        """The target as it is presented: a sphere whose surface the palm has to reach."""
        return ReachTarget(np.array(self.position), aim=AIM)


def grid_targets() -> list[ReachTarget]:
    """Return the 27 targets of the thesis: spheres with a diameter of 10 cm on a grid in the workspace."""
    return [ReachTarget(place, aim=AIM) for place in grid()]


def touchable(known: PeerBelief, target: ReachTarget) -> bool:
    """Return whether inverse kinematics finds a valid pose with the palm within 2 cm of the target's surface.

    A pose is valid if it is within limits and cable constraints, and its only contact of solids is that of hand and target.  `known`: model
    of robot and world, into which the target is put.
    """
    known.present(target)
    low, high = known.range.T
    starts = np.random.default_rng(27).uniform(low, high, (POSES, len(known.columns)))
    poses, missing = approach(known, starts, target.position, target.radius + SUCCESS_DISTANCE - IK_MARGIN, known.range)
    poses = poses[missing <= IK_MARGIN]
    return len(poses) > 0 and bool(known.sound(poses, "grasping").any())


def grid_problems(seed: int) -> list[Problem]:
    """Return a problem for each of the thesis' 27 targets, with a random first pose each; some cannot be reached.

    `seed`: of the draw.
    """
    rng, known = np.random.default_rng([seed, 271]), belief()
    return [_begun(known, GRID, number, target, rng) for number, target in enumerate(grid_targets())]


def fresh_problems(seed: int, count: int) -> list[Problem]:
    """Return `count` problems with new targets that can be reached.

    The targets are drawn in the box around the 27 targets.  `seed`: of the draw.  Raises InvalidValue if 1000 draws are not enough.
    """
    rng, known, places = np.random.default_rng([seed, 50]), belief(), grid()
    found: list[Problem] = []
    for _ in range(DRAWS):
        target = ReachTarget(rng.uniform(places.min(axis=0), places.max(axis=0)), aim=AIM)
        if touchable(known, target):
            found.append(_begun(known, FRESH, len(found), target, rng))
        if len(found) == count:
            return found
    raise InvalidValue(f"only {len(found)} of {count} targets were found in {DRAWS} draws: use another seed.")


def moving_problems(seed: int, count: int) -> list[Problem]:
    """Return `count` problems with a new target that moves, and `count` with an obstacle that crosses the path of the hand.

    There are fewer if too few of the drawn targets allow such a motion.  `seed`: of the draw.
    """
    rng, known, found = np.random.default_rng([seed, 51]), belief(), list[Problem]()
    for problem in fresh_problems(seed + 1000, SPARE * count):
        if len(found) < count:
            to = rng.uniform(-1.0, 1.0, 3)
            other = problem.target.position + MOVED_DISTANCE * to / np.linalg.norm(to)
            if touchable(known, ReachTarget(other, aim=AIM)):
                found.append(structs.replace(problem, kind=TARGET_MOVES, number=len(found), path=[problem.position, other.tolist()]))
        elif len(found) < 2 * count:
            path = _across(known, problem, rng)
            if path is not None:
                found.append(structs.replace(problem, kind=OBSTACLE_MOVES, number=len(found), path=path))
    return found


def _across(known: PeerBelief, problem: Problem, rng: np.random.Generator) -> list[list[float]] | None:
    """Return the two ends of a path on which an obstacle crosses the middle between hand and target; None if none was found.

    The whole path is clear of the target; its ends are clear of the robot.
    """
    start = np.array(problem.start)[: len(known.columns)]
    target, hand = problem.target, known.model.evaluate(known.whole(start)).position(known.marker)
    out = target.position - hand
    for _ in range(PATHS):
        across = np.cross(out, rng.normal(size=3))
        ends = hand + 0.5 * out + MOVED_DISTANCE * np.array([[1.0], [-1.0]]) * across / np.linalg.norm(across)
        places = ends[0] + np.linspace(0.0, 1.0, 9)[:, None] * (ends[1] - ends[0])
        if np.linalg.norm(places - target.position, axis=1).min() < OBSTACLE + target.radius + CLEAR:
            return None
        if all(_is_clear(known, start, end) for end in ends):
            return [end.tolist() for end in ends]
    return None


def _is_clear(known: PeerBelief, start: Array, place: Array) -> bool:
    """Return whether an obstacle at `place` does not touch the robot in the pose `start`."""
    known.present(ReachTarget(place, OBSTACLE + CLEAR))
    return bool(known.sound(start[None])[0])


def _begun(known: PeerBelief, kind: str, number: int, target: ReachTarget, rng: np.random.Generator) -> Problem:
    """Return a problem with a random first pose without contacts of fields.

    If no such pose is found (the target may lie inside the body), contacts with the target are ignored.
    """
    low, high = known.limits.T
    for there in (target, AWAY):
        known.present(there)
        for _ in range(DRAWS):
            q: Array = rng.uniform(low, high)
            if known.sound(q[None], "fields")[0] and known.sound(q[None])[0]:
                return Problem(kind, number, target.position.tolist(), posture(known, q).tolist())
    raise InvalidValue(f"no first pose was found in {DRAWS} draws: use another seed.")


def posture(known: PeerBelief, q: Array) -> Array:
    """Return the posture of the right arm (n_part,) rad from the angles `q` (d,) rad of the motors that the planner moves.

    The other motors are at home.  `known`: the planner's model, as `belief` returns it.
    """
    found: Array = known.whole(q)[robot().parts[PART].slice]
    return found


def train(file: Path, seed: int, transitions: int, tries: int) -> None:
    """Learn transitions, and then to reach for the 27 targets, on the offline plant; everything is recorded in `file`.

    `seed`: of agent and plant.  `transitions`, `tries`: total numbers at the end.  What `file` already has is included, so that an
    interrupted call can be repeated.
    """
    plant = offline_plant(seed)
    with TransitionStore(file, PART) as store:
        agent = CuriousAgent(space(), plant, seed=seed, store=store)
        agent.run(max(0, transitions - agent.transitions))
    reacher = learner(plant, seed, file)
    reacher.learn(grid_targets(), max(0, tries - reacher.tries))


def learner(plant: ReachPlant, seed: int, file: Path) -> ReachAgent:
    """Return the reach learner that records its reaches in `file`; it continues with those that are already recorded there.

    The learned transitions must already be in `file`.  `seed`: of the learner.
    """
    known = load_learned(file, PART, plant.robot)
    store = ReachStore(file, PART)
    return LEARNERS[LEARNER].agent(known.space, plant, known.model.debiased(), marker=MARKER, seed=seed, store=store)
