"""What is to be reached from where: the situations that the thesis names (5.3, 8.1, 8.2, 9.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.reaching.arm import arm_belief, reachable
from experiments.reaching.peer_belief import PeerBelief
from experiments.reaching.peer_goals import approach
from mobee import World, sphere
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

SCENES = ("free", "around", "against", "between", "moving")
"""From anywhere; the hand behind the target; the hand at it, and not with the palm; a ball between hand and target; a target that moves."""
OBSTACLE, RADIUS = "obstacle", 0.04  # m
NEAR = 0.25  # m: the hand behind the target is no farther
TOUCH = 0.03  # m: so near to the target a link is "at" it
WAY = (0.05, 0.12)  # m that a target moves, at least and at most
SPEED = 0.03  # m/s
DRAWS = 4000


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A target, the pose (4,) rad to begin in, and if there are, where an obstacle is and where the target goes, (3,) m."""

    target: ReachTarget
    start: Array
    obstacle: Array | None = None
    to: Array | None = None

    def world(self) -> World:
        """All but the target."""
        world = World()
        if self.obstacle is not None:
            world.add(OBSTACLE, sphere(RADIUS), position=self.obstacle)
        return world

    def target_at(self, seconds: float) -> Array:
        """Where the target is so long after it was presented, (3,) m."""
        if self.to is None:
            return self.target.position
        way = self.to - self.target.position
        found: Array = self.target.position + way * min(1.0, SPEED * seconds / float(np.linalg.norm(way)))
        return found


def make_cases(scene: str, count: int, seed: int) -> list[Case]:
    """That many cases of one of the SCENES; nothing solid touches where they begin."""
    rng = np.random.default_rng([seed, 87, SCENES.index(scene)])
    targets, found = reachable(), []
    for _ in range(DRAWS):
        target = targets[rng.integers(len(targets))]
        case = _case(scene, target, rng)
        if case is not None:
            found.append(case)
        if len(found) == count:
            return found
    raise InvalidValue(f"only {len(found)} of {count} cases of {scene!r} in {DRAWS} draws: take another seed.")


def _case(scene: str, target: ReachTarget, rng: np.random.Generator) -> Case | None:
    belief = arm_belief()
    belief.present(target)
    q = rng.uniform(*belief.limits.T)
    hand = belief.model.evaluate(belief.whole(q)).position(belief.marker)
    obstacle, to = None, None
    if scene == "between":
        way = target.position - hand
        if np.linalg.norm(way) < 2.0 * (target.radius + 2.0 * RADIUS):
            return None
        obstacle = hand + 0.5 * way
        belief.model.world.add(OBSTACLE, sphere(RADIUS), position=obstacle)
    elif scene == "moving":
        to = _goal_of(target, belief, rng)
    fits = {"around": _behind, "against": _touches}.get(scene)
    if not belief.sound(q[None])[0] or (fits is not None and not fits(belief, target, q, hand)) or (scene == "moving" and to is None):
        return None
    return Case(target, q, obstacle, to)


def _behind(belief: PeerBelief, target: ReachTarget, q: Array, hand: Array) -> bool:
    """Whether the target is between the shoulder and the hand."""
    robot = belief.model.robot
    shoulder = robot.joints[int(np.flatnonzero(robot.coupling[0][:, belief.columns[0]])[0])].point  # the torso is at home
    way, out = hand - shoulder, target.position - shoulder
    off = np.linalg.norm(out - way * (out @ way) / (way @ way))
    return bool(off < target.radius and out @ way < way @ way and np.linalg.norm(hand - target.position) < NEAR)


def _touches(belief: PeerBelief, target: ReachTarget, q: Array, hand: Array) -> bool:
    """Whether a solid of the arm is within TOUCH of the target, and the palm is not turned to it."""
    pose = belief.model.evaluate(belief.whole(q))
    belief.model.world.remove("reach_target")
    belief.present(ReachTarget(target.position, target.radius + TOUCH))
    near = not belief.sound(q[None])[0]
    belief.present(target)
    return near and float(pose.normal(belief.marker) @ (target.position - hand)) < 0.0


def _goal_of(target: ReachTarget, belief: PeerBelief, rng: np.random.Generator) -> Array | None:
    """A place some way off to which the palm can come too."""
    way = rng.normal(size=3)
    place = target.position + rng.uniform(*WAY) * way / np.linalg.norm(way)
    starts = rng.uniform(*belief.limits.T, (16, len(belief.limits)))
    missing = approach(belief, starts, place, target.radius, belief.limits)[1]
    return place if missing.min() < 1e-3 else None

