# SPDX-License-Identifier: Apache-2.0
"""Random cases of reaching (thesis 5.3, 8.1, 8.2, 9.3), attempted with the planner alone, with the reach alone, and with both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from experiments.kit.control.plant_runs import place
from experiments.kit.reaching.arm import MARKER, PART, arm_belief, arm_plant, hands, learned_transitions, reach_agent
from experiments.kit.reaching.belief import PeerBelief, approach
from experiments.kit.reaching.learning import Course
from experiments.kit.reaching.targets import GOOD, touchable, touchable_targets
from mobee import MotorParameters, OfflinePlant, World, sphere
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import RADIUS, ReachTarget, reward_of

SCENES = ("free", "around", "against", "between", "moving")
"""The kinds of cases.

"free": any start pose.  "around": the hand is behind the target.  "against": the back of the hand is at the target.  "between": a ball is
between hand and target.  "moving": the target moves.
"""
OBSTACLE, BALL = "obstacle", 0.04  # m, radius
MIN_GAP = 0.14  # m from the centre of the obstacle to those of palm and target
MAX_BEHIND = 0.25  # m from the target to a hand behind it
MIN_BEHIND_COSINE = np.cos(np.deg2rad(70.0))  # between the vectors from shoulder to target and from target to hand
TOUCH = 0.03  # m: a link within this distance is "at" the target
MOVED = (0.05, 0.12)  # m, least and largest motion of a target
SPEED = 0.03  # m/s
MAX_DRAWS = 20_000


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A case: a target and the start pose of the arm, `start` (4,) rad.

    `obstacle`: (3,) m, position of a ball; None: no ball.  `to`: (3,) m, position to which the target moves; None: it does not move.
    `to_and_fro`: the target moves back and forth and never stops.  Positions are in the root frame.
    """

    target: ReachTarget
    start: Array
    obstacle: Array | None = None
    to: Array | None = None
    to_and_fro: bool = False

    def world(self) -> World:
        """Return a new world with the obstacle, if there is one, and without the target."""
        world = World()
        if self.obstacle is not None:
            world.add(OBSTACLE, sphere(BALL), position=self.obstacle)
        return world

    def target_at(self, seconds: float) -> Array:
        """Return the position of the target, (3,) m, `seconds` after it was first presented."""
        if self.to is None:
            return self.target.position
        offset = self.to - self.target.position
        gone = SPEED * seconds / float(np.linalg.norm(offset))
        share = 1.0 - abs(1.0 - gone % 2.0) if self.to_and_fro else min(1.0, gone)
        found: Array = self.target.position + share * offset
        return found

    def seen_at(self, seconds: float) -> ReachTarget:
        """Return the target at its position `seconds` after it was first presented."""
        return replace(self.target, position=self.target_at(seconds))


def make_cases(scene: str, count: int, seed: int, law: str = "default", free: bool = False) -> list[Case]:
    """Draw `count` random cases (target, start pose, obstacle) of a kind; raises InvalidValue if too few are found.

    The targets are drawn from those of `touchable_targets`.  In a start pose no solid touches anything.  `scene`: "free", "around",
    "against", "between" or "moving", as explained at SCENES.  `seed`: seed of the draws.  `law`: "default" with today's robot, or
    "published" with the robot of 2014.  `free`: True: only targets that the palm can touch in a pose in which no joint limit exerts a
    force; False: joint limits may exert forces in this pose.
    """
    rng = np.random.default_rng([seed, 87, SCENES.index(scene)])
    targets, belief = touchable_targets(law, free), arm_belief(law=law)
    found: list[Case] = []
    for _ in range(MAX_DRAWS):
        case = _case(scene, targets[rng.integers(len(targets))], belief, rng)
        if case is not None:
            found.append(case)
        if len(found) == count:
            return found
    raise InvalidValue(f"only {len(found)} of {count} cases of {scene!r} in {MAX_DRAWS} draws: use another seed.")


def _case(scene: str, target: ReachTarget, belief: PeerBelief, rng: np.random.Generator) -> Case | None:
    """Draw a start pose; None if it does not suit the scene."""
    low, high = belief.limits.T
    q = rng.uniform(low, high)
    hand = belief.model.evaluate(belief.whole(q)).position(belief.marker)
    offset = target.position - hand
    if scene == "around" and not _behind(belief, target, hand):
        return None
    belief.present(target)
    if not belief.sound(q[None])[0] or (scene == "against" and not _touches(belief, target, q, offset)):
        return None
    if scene == "between":
        obstacle = hand + 0.5 * offset
        apart = float(np.linalg.norm(offset)) / 2.0
        return Case(target, q, obstacle) if apart > MIN_GAP and _leaves_path(belief, target, q, obstacle) else None
    if scene == "moving":
        to = _goal_of(target, belief, rng)
        return None if to is None else Case(target, q, to=to)
    return Case(target, q)


def _leaves_path(belief: PeerBelief, target: ReachTarget, q: Array, obstacle: Array) -> bool:
    """Return whether the start pose, and some pose with the palm on the target, are free of the obstacle."""
    world = belief.model.world
    world.add(OBSTACLE, sphere(BALL), position=obstacle)
    leaves = bool(belief.sound(q[None])[0]) and touchable(belief, target, free=False)
    world.remove(OBSTACLE)
    return leaves


def _behind(belief: PeerBelief, target: ReachTarget, hand: Array) -> bool:
    """Return whether the hand is on the far side of the target, as seen from the shoulder."""
    robot = belief.model.robot
    shoulder = robot.joints[int(np.flatnonzero(robot.coupling[0][:, belief.columns[0]])[0])].point  # the torso is at home
    out, beyond = target.position - shoulder, hand - target.position
    length = float(np.linalg.norm(beyond))
    return bool(length < MAX_BEHIND and out @ beyond > MIN_BEHIND_COSINE * np.linalg.norm(out) * length)


def _touches(belief: PeerBelief, target: ReachTarget, q: Array, offset: Array) -> bool:
    """Return whether a solid of the arm is at the target, and the palm faces away from the target.

    "At the target" is: within 3 cm (TOUCH) of its surface.  `q`: (4,) rad, pose of the arm, without a contact of solids.  `offset`: (3,) m,
    root frame, vector from the palm to the target's centre.
    """
    belief.present(ReachTarget(target.position, target.radius + TOUCH))
    near = not belief.sound(q[None])[0]
    belief.present(target)
    return near and float(belief.model.evaluate(belief.whole(q)).normal(belief.marker) @ offset) < 0.0


def _goal_of(target: ReachTarget, belief: PeerBelief, rng: np.random.Generator) -> Array | None:
    """Draw a place, (3,) m, root frame, 5 to 12 cm (MOVED) from the target's centre, in any direction.

    Returns None if inverse kinematics does not bring the palm to the surface of the target, moved to this place.
    """
    offset = rng.normal(size=3)
    place = target.position + rng.uniform(*MOVED) * offset / np.linalg.norm(offset)
    low, high = belief.limits.T
    starts = rng.uniform(low, high, (16, len(belief.limits)))
    missing = approach(belief, starts, place, target.radius, belief.limits)[1]
    return place if missing.min() < 1e-3 else None


METHODS = ("planner", "reach", "both")
EVERY = 5  # ticks between two positions of a target that moves
REACHES = {"published": 1, "default": 3}  # per case; the thesis reached once


@dataclass(frozen=True, slots=True)
class Attempt:
    """The result of one attempt to bring the palm to a target.

    `missing`: distance of the palm from the target's surface at the end [m].  `seconds`: duration by the plant's clock [s].  `thinking`:
    processor time for plans [s]. `reward`: reward of the attempt (thesis eq. 8.4), computed from the palm's distance to the target's
    centre, or to its surface if the target's `aim` is "surface".
    """

    missing: float
    seconds: float
    thinking: float
    reward: float


def trained(seed: int, transitions: int, tries: int, law: str = "default", free: bool = False) -> ReachAgent:
    """Return a reach learner that was trained on the 27 targets of `touchable_targets`, in an empty world.

    `seed`: seed of the plant and the agent.  `transitions`: number of transitions that the agent learns before it tries to reach.  `tries`:
    number of problem-tries, each one an attempt to reach one target.  `law`: "default" with today's robot, or "published" with the robot of
    2014.  `free`: True: only targets that the palm can touch in a pose in which no joint limit exerts a force; False: joint limits may
    exert forces in this pose.
    """
    plant = arm_plant(seed + 500, law=law)
    agent = reach_agent(plant, learned_transitions(plant, seed, transitions, law), seed, law)
    agent.learn(touchable_targets(law, free), tries)
    return agent


def attempt(method: str, agent: ReachAgent, case: Case, seed: int, motors: MotorParameters | None = None, law: str = "default") -> Attempt:
    """Try to bring the palm to the target of a case, and return the result; at first the arm is at rest in the start pose.

    `method`: "planner": move to a state with the palm near the target, without a reach; "reach": reach from the start pose; "both": move to
    the state with the highest expected reward of reaching, then reach.  In a reach, a force pulls the palm to the target.  A reach that
    misses is repeated, up to REACHES times in all (1 for the control law "published", 3 for "default"). `agent`: the trained learner.
    `seed`: seed of the plant, and of choices among equally good actions.  `motors`: motor parameters; None: the default ones.  `law`:
    "default" or "published".
    """
    plant = begun(case, seed, motors, law)
    start = plant.time
    plant.present(case.target)
    plant.every(EVERY, (lambda now: plant.present(case.seen_at(now - start))) if case.to is not None else None)
    worth = partial(_nearness, hands(law)) if method == "planner" else agent.predictor.mean
    course = Course(plant, agent, worth, lambda: case.target_at(plant.time - start), np.random.default_rng([seed, 88]))
    for _ in range(1 if method == "planner" else REACHES[law]):
        if method != "reach":
            course.go()
        aimed = _missing(plant, case, start) if method == "planner" else plant.reach(PART, MARKER).missing
        missing = aimed if case.target.aim == "surface" else max(aimed - case.target.radius, 0.0)
        if missing <= GOOD:
            break
        course.missed()
    return Attempt(missing, plant.time - start, course.thinking, reward_of(aimed))


def _missing(plant: OfflinePlant, case: Case, start: float) -> float:
    """Return the present distance [m] of the palm from the target's centre, or from its surface if the target's `aim` is "surface".

    The target is where the case puts it now.  `start`: time of the plant [s] at which the target was first presented.
    """
    whole = plant.q
    return case.seen_at(plant.time - start).missing(plant.model.evaluate(whole).position(MARKER))


def begun(case: Case, seed: int, motors: MotorParameters | None = None, law: str = "default") -> OfflinePlant:
    """Return a plant in the world of a case, without the target, with the arm at rest in the start pose.

    `seed`: seed of the plant's random numbers.  `motors`: motor parameters; None: the default ones.  `law`: "default" with today's robot,
    or "published" with the robot of 2014.
    """
    plant = arm_plant(seed, case.world(), motors, law)
    place(plant, arm_belief(law=law).whole(case.start))
    return plant


def _nearness(palms: Array, target: Array) -> Array:
    """Return the expected reward in each state if no reach follows, (S,), computed from the palm's distance to the target.

    The reward is that of thesis eq. 8.4, with the distance to the surface of a target of the default radius (5 cm) as the remaining error.
    `palms`: (S, 3) m, root frame, position of the palm in each state.  `target`: (3,) m, root frame, centre of the target.
    """
    distances = np.maximum(np.linalg.norm(palms - target, axis=1) - RADIUS, 0.0)
    return np.array([reward_of(float(distance)) for distance in distances])
