"""Blocks of tries on the live robot: real processes in lockstep, with PyBullet."""

from __future__ import annotations

from pathlib import Path

from experiments.kit.live import summary_of, write_job
from experiments.live_reach.job import Job
from experiments.live_reach.settings import GAINS, RATE, ROBOT, WORLD

WITH_OBSTACLE = Path(__file__).with_name("obstacle.xml")
LONGEST = 120.0  # s of robot time for a try, on average over a block
PATIENCE = 60.0  # s for a tick: a plan is made in one

_SCENARIO = """# Written by the experiment `live-reach`.
title = "Reaching with PyBullet: {kind}"

[shared]
robot = "{robot}"
world = "{world}"
gains = "{gains}"
seed = {seed}
mode = "lock"
patience = {patience}

[services.robot_sim]
rate = {rate}
record = "{folder}"

[services.model]
[services.controller]

[services.performer]
module = "experiments.live_reach.performer"
run_dir = "{folder}"
"""


def perform(folder: Path, job: Job, seed: int, rate: float = RATE) -> bool:
    """Launch a system with one job, leave its record of every tick in the folder; whether the run can be repeated.

    `seed`: of the simulated robot.  Raises LaunchFailed.
    """
    write_job(folder, job)
    world = WITH_OBSTACLE if job.kind == "moving" else WORLD
    text = _SCENARIO.format(
        kind=job.kind, robot=ROBOT, world=world, gains=GAINS, seed=seed, patience=PATIENCE, rate=rate, folder=folder.resolve()
    )
    scenario = folder / "scenario.toml"
    scenario.write_text(text)
    tries = max(1, len(job.problems) + job.tries)
    summary = summary_of(str(scenario), ticks=round(LONGEST * rate * tries), runs=folder / "launches")
    return bool(summary["lockstep"]["repeatable"])
