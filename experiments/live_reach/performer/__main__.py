"""`python -m experiments.live_reach.performer`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from experiments.kit.live import read_job
from experiments.live_reach.job import Job
from experiments.live_reach.performer.config import Config
from experiments.live_reach.performer.mover import Mover
from experiments.live_reach.performer.node import perform
from experiments.live_reach.settings import RATE
from mobee import load_robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import Service


def main(argv: Sequence[str] | None = None) -> None:
    """Do the job, and have the system end."""
    config = load_config(Config, argv, "experiments.live_reach.performer")
    with explained("experiments.live_reach.performer"):
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


if __name__ == "__main__":
    main()
