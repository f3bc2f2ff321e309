"""The performer at work."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from bus_schema import keys
from bus_schema.rpc import Done, Empty
from experiments.kit.live import append_done
from experiments.live_reach.job import Job, Tried
from experiments.live_reach.performer.contestants import Ended, contestant
from experiments.live_reach.performer.hand import Hand
from experiments.live_reach.performer.mover import Mover
from experiments.live_reach.problems import Problem, grid_targets
from experiments.live_reach.settings import PART, WRIST
from experiments.live_reach.training import learner
from mobee import ActionInterrupted
from mobee.robot.robot import Robot
from services.common.service import Service


def perform(service: Service, robot: Robot, job: Job, folder: Path, mover: Mover | None) -> None:
    """Do the whole job, and have the launcher end everything."""
    hand = Hand(service, robot)
    attempt = contestant(hand, job, mover)
    agent = learner(hand, job.seed, Path(job.store)) if job.kind == "refine" else None
    service.ready()
    hand.measure(PART)
    if agent is not None:
        agent.learn(grid_targets(), max(0, job.tries - agent.tries))
    for problem in job.problems:
        append_done(folder, _tried(hand, problem, attempt))
    hand.leave()
    if mover is not None:
        mover.leave()
    service.call(keys.service_rpc("launcher", "shutdown"), Empty, Done, tries=3)
    service.run()


def _tried(hand: Hand, problem: Problem, attempt: Callable[[Problem], Ended]) -> Tried:
    """One try from the posture to begin in, to which the arm comes from home."""
    start, off, why = np.array(problem.start), np.inf, ""
    out = begin = hand.tick
    try:
        hand.present(None)
        hand.act(PART, hand.robot.home[hand.robot.part(PART).slice])
        off = float(np.abs(hand.act(PART, start).q - start)[:WRIST].max())
        begin = hand.tick
        made = attempt(problem)
    except ActionInterrupted as error:
        hand.measure(PART)
        made, why = Ended([], 0, np.inf), str(error)
    return Tried(
        kind=problem.kind,
        number=problem.number,
        out=out,
        begin=begin,
        ends=made.ends,
        over=hand.tick,
        off=off,
        actions=made.actions,
        believed=made.believed,
        thinking=made.thinking,
        asked=hand.asked,
        first=made.first,
        why=why,
        there=made.there,
    )
