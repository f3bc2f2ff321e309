"""`python -m experiments.babbling.babbler`."""

from __future__ import annotations

from collections.abc import Sequence

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
        with Service("babbler", config, robot) as service:
            BabblerNode(service, config, robot).run()


if __name__ == "__main__":
    main()
