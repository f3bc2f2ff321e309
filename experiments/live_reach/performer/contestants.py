"""Who brings the palm to a target: the learner, the planner, or the reach alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.kit.reaching.learning import Course
from experiments.kit.reaching.planner_peer import PlannerPeer
from experiments.live_reach.job import Job
from experiments.live_reach.performer.hand import Hand
from experiments.live_reach.performer.mover import OBSTACLE, THING, Mover
from experiments.live_reach.performer.peer_plant import PeerPlant
from experiments.live_reach.problems import TARGET_MOVES, Problem
from experiments.live_reach.settings import AIM, APART, GOOD, MARKER, PART, RATE, REACHES, belief
from mobee.learning.reaching.learned_reaches import load_reaches
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True)
class Ended:
    """How an attempt ended.

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
    """Who does a job, with all that is needed loaded."""
    if job.kind == "peer":
        return partial(planned, hand, job.seed)
    if job.kind in ("learner", "moving"):
        agent = load_reaches(job.store, hand, PART)
        for problem in job.problems:
            agent.predictor.mean(problem.target.position)  # what a target costs that was never asked about is paid here
        return partial(learned, hand, agent, job.seed, mover)
    if job.kind == "first motion":
        hand.look_at_commands()
    return partial(at_once, hand)


def learned(hand: Hand, agent: ReachAgent, seed: int, mover: Mover | None, problem: Problem) -> Ended:
    """Go to where a reach is expected to bring most, and reach; who missed does so again from elsewhere."""
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
    """Show the target, and let move what moves; where the target is now, (3,) m."""
    target = problem.target
    if mover is not None and problem.way is not None:
        mover.start(THING if problem.kind == TARGET_MOVES else OBSTACLE, problem.way)
        if problem.kind == TARGET_MOVES:
            hand.present_object(THING, AIM)
            return mover.now
    hand.present(target)
    return lambda: target.position


def planned(hand: Hand, seed: int, problem: Problem) -> Ended:
    """Inverse kinematics and RRT-Connect, planned anew whenever something came otherwise."""
    plant = PeerPlant(hand, 1.0 / RATE)
    peer = PlannerPeer(plant, belief(), PART, "none", seed + problem.number)
    made = peer.try_problem(problem.target)
    return Ended(plant.ends, made.actions, made.missing, made.planning)


def at_once(hand: Hand, problem: Problem) -> Ended:
    """Reach from where the arm is."""
    hand.present(problem.target)
    missing = hand.reach(PART, MARKER).missing
    return Ended([hand.end], 1, missing, first=hand.first)
