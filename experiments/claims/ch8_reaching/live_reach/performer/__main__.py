"""The performer process: it does one job on the live robot, and has the launcher end the system."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from bus_schema import keys
from bus_schema.rpc import Done, Empty
from experiments.claims.ch8_reaching.live_reach.performer.config import Config
from experiments.claims.ch8_reaching.live_reach.performer.contestants import Ended, contestant
from experiments.claims.ch8_reaching.live_reach.performer.hand import Hand, Mover
from experiments.claims.ch8_reaching.live_reach.problems import RATE, WRIST, Problem, grid_targets, learner
from experiments.claims.ch8_reaching.live_reach.tries import Job, Tried
from experiments.kit.live.launch import append_done, read_job
from experiments.kit.reaching.arm import PART
from mobee import ActionInterrupted, load_robot
from mobee.robot.robot import Robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import Service


def main(argv: Sequence[str] | None = None) -> None:
    """Do the job, and have the system end."""
    config = load_config(Config, argv, "experiments.claims.ch8_reaching.live_reach.performer")
    with explained("experiments.claims.ch8_reaching.live_reach.performer"):
        robot = load_robot(config.robot)
        folder = Path(config.run_dir)
        job = read_job(folder, Job)
        with Service("performer", config, robot) as service, ExitStack() as stack:
            mover = None
            if job.kind == "moving":
                other = stack.enter_context(Service("mover", config, robot, inbox=service.inbox))
                mover = Mover(other, 1.0 / RATE)
                other.ready()
            perform(service, robot, job, folder, mover)


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


if __name__ == "__main__":
    main()
