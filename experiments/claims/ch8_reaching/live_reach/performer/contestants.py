"""The contestants on the live robot: the learner, the planner, and the reach alone, each as a function of a problem."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.claims.ch8_reaching.live_reach.performer.hand import OBSTACLE, THING, Hand, Mover
from experiments.claims.ch8_reaching.live_reach.problems import AIM, APART, GOOD, RATE, REACHES, TARGET_MOVES, Problem, belief
from experiments.claims.ch8_reaching.live_reach.tries import Job
from experiments.kit.reaching.arm import MARKER, PART
from experiments.kit.reaching.learning import Course
from experiments.kit.reaching.planner_peer import PlannerPeer
from mobee import Model
from mobee.arrays import Array
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.record import load_reaches
from mobee.plant import Outcome
from mobee.reach import ReachTarget


@dataclass(frozen=True, slots=True)
class Ended:
    """The result of an attempt.

    `ends`: ticks at which the palm was to be there.  `actions`: how many, reaches included.  `believed`: m that were missing in the end, by
    the encoders.  `thinking`: s of processor time spent on plans.  `first`: ticks from the request of the last reach to the first command
    that moves, -1 where nobody looked.
    """

    ends: list[int]
    actions: int
    believed: float
    thinking: float = 0.0
    first: int = -1
    there: list[float] | None = None
    """Where a target that moves was at the last of the ends, m."""


def contestant(hand: Hand, job: Job, mover: Mover | None) -> Callable[[Problem], Ended]:
    """The contestant of a job, with all that it needs loaded."""
    if job.kind == "peer":
        return partial(planned, hand, job.seed)
    if job.kind in ("learner", "moving"):
        agent = load_reaches(job.store, hand, PART)
        for problem in job.problems:
            agent.predictor.mean(problem.target.position)  # the first prediction for a target is slow: it is made before the try
        return partial(learned, hand, agent, job.seed, mover)
    if job.kind == "first motion":
        hand.watch_commands()
    return partial(at_once, hand)


def learned(hand: Hand, agent: ReachAgent, seed: int, mover: Mover | None, problem: Problem) -> Ended:
    """Go to the state with the highest expected reward, and reach; after a miss, again from another state."""
    where = _present(hand, mover, problem)
    course = Course(hand, agent, agent.predictor.mean, where, np.random.default_rng([seed, problem.number]), APART)
    ends: list[int] = []
    missing = np.inf
    while len(ends) < REACHES and missing > GOOD:
        course.go()
        missing = hand.reach(PART, MARKER).missing
        ends.append(hand.end)
        course.missed()
    there = None
    if mover is not None:
        there = mover.at(ends[-1]).tolist() if problem.kind == TARGET_MOVES else None
        mover.stop()
    return Ended(ends, course.actions + len(ends), missing, course.thinking, there=there)


def _present(hand: Hand, mover: Mover | None, problem: Problem) -> Callable[[], Array]:
    """Present the target, and start what moves; returns a function of the target's position now, (3,) m."""
    target = problem.target
    if mover is not None and problem.path is not None:
        mover.start(THING if problem.kind == TARGET_MOVES else OBSTACLE, problem.path)
        if problem.kind == TARGET_MOVES:
            hand.present_object(THING, AIM)
            return mover.now
    hand.present(target)
    return lambda: target.position


def planned(hand: Hand, seed: int, problem: Problem) -> Ended:
    """Inverse kinematics and RRT-Connect, planned anew after every unexpected outcome."""
    plant = PeerPlant(hand, 1.0 / RATE)
    peer = PlannerPeer(plant, belief(), PART, "none", seed + problem.number)
    made = peer.try_problem(problem.target)
    return Ended(plant.ends, made.actions, made.missing, made.planning)


def at_once(hand: Hand, problem: Problem) -> Ended:
    """Reach from where the arm is."""
    hand.present(problem.target)
    missing = hand.reach(PART, MARKER).missing
    return Ended([hand.end], 1, missing, first=hand.first)


class PeerPlant:
    """The live arm as the planner peer drives it; the target repels nothing during motions, for the planner has planned around it."""

    def __init__(self, hand: Hand, tick: float) -> None:
        """`tick`: s."""
        self.robot, self.ends = hand.robot, list[int]()
        """Ticks at which the marker was to be at the target."""
        self._hand, self._model, self._dt = hand, Model(hand.robot), tick
        self._target: ReachTarget | None = None

    @property
    def time(self) -> float:
        """Of the robot, s."""
        return self._hand.tick * self._dt

    @property
    def q(self) -> Array:
        """See Plant."""
        return self._hand.q

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self._hand.measure(part)

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """See JudgedPlant."""
        self._hand.present(None)
        return self._hand.act(part, target)

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        self._target = target
        self._hand.present(target)

    def missing(self, marker: str) -> float:
        """How far the marker is from the target by the encoders, now; m."""
        self.ends.append(self._hand.tick)
        whole = self.robot.home.copy()
        whole[self.robot.part(PART).slice] = self.measure(PART)
        target = self._target
        return np.inf if target is None else target.missing(self._model.evaluate(whole).position(marker))
