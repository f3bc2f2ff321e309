"""`python -m experiments.babbling.babbler`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack

from msgspec import structs

from experiments.babbling.babbler.config import Config
from experiments.babbling.babbler.node import BabblerNode
from mobee import load_robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import Service


def main(argv: Sequence[str] | None = None) -> None:
    """Babble until the robot time is over."""
    config = load_config(Config, argv, "experiments.babbling.babbler")
    with explained("experiments.babbling.babbler"):
        robot = load_robot(config.robot)
        with Service("babbler", config, robot) as service, ExitStack() as stack:
            client = service
            if config.robot_of != config.namespace:
                theirs = structs.replace(config, namespace=config.robot_of)
                client = stack.enter_context(Service("babbler", theirs, robot, inbox=service.inbox))
            BabblerNode(client, config, robot)
            client.ready()
            if client is not service:
                service.ready()
            service.run()


if __name__ == "__main__":
    main()
