"""`python -m experiments.replanning.performer`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from bus_schema import keys
from bus_schema.rpc import Done, Empty
from experiments.kit.live import append_done, read_job
from experiments.kit.walking import FeelingPlant
from experiments.replanning.job import Crossing, Job
from experiments.replanning.performer.config import Config
from experiments.replanning.performer.crosser import Crosser
from experiments.replanning.scene import BALL, LEFT, PART, RIGHT, new_map
from mobee import ActionInterrupted, load_robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import Service


def whole(crosser: Crosser, after: float) -> Crossing:
    """A crossing that nothing interrupted: where the machine is too busy for real time the robot holds, and it is made once more."""
    while True:
        try:
            return crosser.cross(after)
        except ActionInterrupted:
            continue


def main(argv: Sequence[str] | None = None) -> None:
    """Cross as often as the job says, and have the system end."""
    name = "experiments.replanning.performer"
    config = load_config(Config, argv, name)
    with explained(name):
        robot, folder = load_robot(config.robot), Path(config.run_dir)
        job = read_job(folder, Job)
        new_map().plan(RIGHT, LEFT)  # what is imported for the first plan is imported before the robot moves
        with Service("performer", config, robot) as service, ExitStack() as stack:
            watcher = None
            if config.mode == "lock":
                watcher = stack.enter_context(Service("watcher", config, robot, inbox=service.inbox))
                watcher.ready()
            hand = FeelingPlant(service, robot, PART, {BALL}, watcher)
            crosser = Crosser(service, hand)
            service.ready()
            hand.measure(PART)
            for after in job.after:
                append_done(folder, whole(crosser, after))
            hand.leave()
            service.call(keys.service_rpc("launcher", "shutdown"), Empty, Done, tries=3)
            service.run()


if __name__ == "__main__":
    main()
