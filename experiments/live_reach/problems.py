"""What is to be reached for, and from where: the thesis' 27 targets, fresh ones between them, and random poses to begin in."""

from __future__ import annotations

import numpy as np
from msgspec import Struct, structs

from experiments.kit.reaching.belief import PeerBelief, approach
from experiments.kit.reaching.targets import grid
from experiments.live_reach.settings import AIM, GOOD, PART, belief, robot
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

POSES = 256  # that inverse kinematics begins from
CLOSE = 5e-3  # m: with so much to spare
DRAWS = 1000
AWAY = ReachTarget(np.array([0.0, 0.0, 10.0]))
GRID, FRESH, TARGET_MOVES, OBSTACLE_MOVES = "grid", "fresh", "target moves", "obstacle moves"
SPEED = 0.03  # m/s, of what moves
FAR = 0.15  # m that a target moves, and an obstacle to either side
OBSTACLE, CLEAR = 0.04, 0.05  # m, its radius, and how far its surface stays from that of the target
SPARE = 6  # fresh targets a problem
WAYS = 8  # across, that are drawn


class Problem(Struct, frozen=True):
    """A target and the posture of the part to begin in."""

    kind: str
    number: int
    position: list[float]  # m, root frame
    start: list[float]  # rad
    way: list[list[float]] | None = None
    """Between which places, m, the target or an obstacle moves to and fro; None: nothing moves."""

    @property
    def target(self) -> ReachTarget:
        """The sphere that is presented."""
        return ReachTarget(np.array(self.position), aim=AIM)


def grid_targets() -> list[ReachTarget]:
    """All 27."""
    return [ReachTarget(place, aim=AIM) for place in grid()]


def touchable(known: PeerBelief, target: ReachTarget) -> bool:
    """Whether inverse kinematics finds a sound pose with the palm within 2 cm of the target's surface.

    Limits and cables hold in it, and no solid touches anything but the hand the target.
    """
    known.present(target)
    low, high = known.range.T
    starts = np.random.default_rng(27).uniform(low, high, (POSES, len(known.columns)))
    poses, missing = approach(known, starts, target.position, target.radius + GOOD - CLOSE, known.range)
    poses = poses[missing <= CLOSE]
    return len(poses) > 0 and bool(known.sound(poses, "grasping").any())


def grid_problems(seed: int) -> list[Problem]:
    """The 27, reachable or not, each from a pose of its own."""
    rng, known = np.random.default_rng([seed, 271]), belief()
    return [_begun(known, GRID, number, target, rng) for number, target in enumerate(grid_targets())]


def fresh_problems(seed: int, count: int) -> list[Problem]:
    """Touchable targets drawn in the box around the 27."""
    rng, known, places = np.random.default_rng([seed, 50]), belief(), grid()
    found: list[Problem] = []
    for _ in range(DRAWS):
        target = ReachTarget(rng.uniform(places.min(axis=0), places.max(axis=0)), aim=AIM)
        if touchable(known, target):
            found.append(_begun(known, FRESH, len(found), target, rng))
        if len(found) == count:
            return found
    raise InvalidValue(f"only {len(found)} of {count} targets in {DRAWS} draws: take another seed.")


def moving_problems(seed: int, count: int) -> list[Problem]:
    """Fresh targets that move, as many with an obstacle that crosses the way of the hand."""
    rng, known, found = np.random.default_rng([seed, 51]), belief(), list[Problem]()
    for problem in fresh_problems(seed + 1000, SPARE * count):
        if len(found) < count:
            to = rng.uniform(-1.0, 1.0, 3)
            other = problem.target.position + FAR * to / np.linalg.norm(to)
            if touchable(known, ReachTarget(other, aim=AIM)):
                found.append(structs.replace(problem, kind=TARGET_MOVES, number=len(found), way=[problem.position, other.tolist()]))
        elif len(found) < 2 * count:
            way = _across(known, problem, rng)
            if way is not None:
                found.append(structs.replace(problem, kind=OBSTACLE_MOVES, number=len(found), way=way))
    return found


def _across(known: PeerBelief, problem: Problem, rng: np.random.Generator) -> list[list[float]] | None:
    """Ends of a way through the middle between hand and target, across it, that stays clear of the target and ends clear of the arm."""
    start = np.array(problem.start)[: len(known.columns)]
    target, hand = problem.target, known.model.evaluate(known.whole(start)).position(known.marker)
    out = target.position - hand
    for _ in range(WAYS):
        across = np.cross(out, rng.normal(size=3))
        ends = hand + 0.5 * out + FAR * np.array([[1.0], [-1.0]]) * across / np.linalg.norm(across)
        places = ends[0] + np.linspace(0.0, 1.0, 9)[:, None] * (ends[1] - ends[0])
        if np.linalg.norm(places - target.position, axis=1).min() < OBSTACLE + target.radius + CLEAR:
            return None
        if all(_is_clear(known, start, end) for end in ends):
            return [end.tolist() for end in ends]
    return None


def _is_clear(known: PeerBelief, start: Array, place: Array) -> bool:
    """Whether an obstacle there touches nothing of the robot in that pose."""
    known.present(ReachTarget(place, OBSTACLE + CLEAR))
    return bool(known.sound(start[None])[0])


def _begun(known: PeerBelief, kind: str, number: int, target: ReachTarget, rng: np.random.Generator) -> Problem:
    """From a pose in which nothing is felt; not even the target, unless it lies in the body."""
    low, high = known.limits.T
    for there in (target, AWAY):
        known.present(there)
        for _ in range(DRAWS):
            q: Array = rng.uniform(low, high)
            if known.sound(q[None], "fields")[0] and known.sound(q[None])[0]:
                return Problem(kind, number, target.position.tolist(), posture(known, q).tolist())
    raise InvalidValue(f"no pose to begin in was found in {DRAWS} draws: take another seed.")


def posture(known: PeerBelief, q: Array) -> Array:
    """Planned motors (d,) as those of the whole part, rad; the others at home."""
    found: Array = known.whole(q)[robot().parts[PART].slice]
    return found
