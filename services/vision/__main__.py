"""`python -m services.vision`."""

from __future__ import annotations

from collections.abc import Sequence

from mobee import load_robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import Service
from services.vision.config import Config
from services.vision.node import VisionNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the target locator until it is told to end."""
    config = load_config(Config, argv, "services.vision")
    with explained("services.vision"):
        robot = load_robot(config.robot)
        with Service("vision", config, robot) as service:
            VisionNode(service, config, robot)
            service.ready()
            service.run()


if __name__ == "__main__":
    main()
