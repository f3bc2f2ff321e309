"""What is to be reached from where: the situations that the thesis names (5.3, 8.1, 8.2, 9.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from experiments.reaching.arm import arm_belief, touchable, touchable_targets
from experiments.reaching.peer_belief import PeerBelief
from experiments.reaching.peer_goals import approach
from mobee import World, sphere
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

SCENES = ("free", "around", "against", "between", "moving")
"""From anywhere; the hand behind the target; the hand at it, and not with the palm; a ball between hand and target; a target that moves."""
OBSTACLE, RADIUS = "obstacle", 0.04  # m
APART = 0.14  # m, at least, from its middle to those of palm and target
NEAR = 0.25  # m: the hand behind the target is no farther from it
BEYOND = np.cos(np.deg2rad(70.0))  # between the way from shoulder to target and that from target to hand
TOUCH = 0.03  # m: so near to the target a link is "at" it
WAY = (0.05, 0.12)  # m that a target moves, at least and at most
SPEED = 0.03  # m/s
DRAWS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A target, the pose (4,) rad to begin in, and if there are, where an obstacle is and where the target goes, (3,) m.

    `to_and_fro`: it never stops.
    """

    target: ReachTarget
    start: Array
    obstacle: Array | None = None
    to: Array | None = None
    to_and_fro: bool = False

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
        gone = SPEED * seconds / float(np.linalg.norm(way))
        share = 1.0 - abs(1.0 - gone % 2.0) if self.to_and_fro else min(1.0, gone)
        found: Array = self.target.position + share * way
        return found

    def seen_at(self, seconds: float) -> ReachTarget:
        """The target so long after it was presented first."""
        return replace(self.target, position=self.target_at(seconds))


def make_cases(scene: str, count: int, seed: int, law: str = "default", free: bool = False) -> list[Case]:
    """That many cases of one of the SCENES, with the targets of `touchable_targets`; nothing solid touches where they begin."""
    rng = np.random.default_rng([seed, 87, SCENES.index(scene)])
    targets, belief = touchable_targets(law, free), arm_belief(law=law)
    found: list[Case] = []
    for _ in range(DRAWS):
        case = _case(scene, targets[rng.integers(len(targets))], belief, rng)
        if case is not None:
            found.append(case)
        if len(found) == count:
            return found
    raise InvalidValue(f"only {len(found)} of {count} cases of {scene!r} in {DRAWS} draws: take another seed.")


def _case(scene: str, target: ReachTarget, belief: PeerBelief, rng: np.random.Generator) -> Case | None:
    """A pose that is drawn, if it fits."""
    q = rng.uniform(*belief.limits.T)
    hand = belief.model.evaluate(belief.whole(q)).position(belief.marker)
    way = target.position - hand
    if scene == "around" and not _behind(belief, target, hand):
        return None
    belief.present(target)
    if not belief.sound(q[None])[0] or (scene == "against" and not _touches(belief, target, q, way)):
        return None
    if scene == "between":
        obstacle = hand + 0.5 * way
        apart = float(np.linalg.norm(way)) / 2.0
        return Case(target, q, obstacle) if apart > APART and _leaves_way(belief, target, q, obstacle) else None
    if scene == "moving":
        to = _goal_of(target, belief, rng)
        return None if to is None else Case(target, q, to=to)
    return Case(target, q)


def _leaves_way(belief: PeerBelief, target: ReachTarget, q: Array, obstacle: Array) -> bool:
    """Whether no solid touches the obstacle in the pose, nor needs to where the palm touches the target."""
    world = belief.model.world
    world.add(OBSTACLE, sphere(RADIUS), position=obstacle)
    leaves = bool(belief.sound(q[None])[0]) and touchable(belief, target, free=False)
    world.remove(OBSTACLE)
    return leaves


def _behind(belief: PeerBelief, target: ReachTarget, hand: Array) -> bool:
    """Whether the hand is on the far side of the target, as seen from the shoulder."""
    robot = belief.model.robot
    shoulder = robot.joints[int(np.flatnonzero(robot.coupling[0][:, belief.columns[0]])[0])].point  # the torso is at home
    out, beyond = target.position - shoulder, hand - target.position
    length = float(np.linalg.norm(beyond))
    return bool(length < NEAR and out @ beyond > BEYOND * np.linalg.norm(out) * length)


def _touches(belief: PeerBelief, target: ReachTarget, q: Array, way: Array) -> bool:
    """Whether a solid of the arm is within TOUCH of the target, and the palm is turned away from it, which lies `way` (3,) m off."""
    belief.present(ReachTarget(target.position, target.radius + TOUCH))
    near = not belief.sound(q[None])[0]
    belief.present(target)
    return near and float(belief.model.evaluate(belief.whole(q)).normal(belief.marker) @ way) < 0.0


def _goal_of(target: ReachTarget, belief: PeerBelief, rng: np.random.Generator) -> Array | None:
    """A place some way off to which the palm can come too."""
    way = rng.normal(size=3)
    place = target.position + rng.uniform(*WAY) * way / np.linalg.norm(way)
    starts = rng.uniform(*belief.limits.T, (16, len(belief.limits)))
    missing = approach(belief, starts, place, target.radius, belief.limits)[1]
    return place if missing.min() < 1e-3 else None
