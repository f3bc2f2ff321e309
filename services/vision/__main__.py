# SPDX-License-Identifier: Apache-2.0
"""`python -m services.vision`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.vision.config import Config
from services.vision.node import VisionNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the target locator until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.vision")
    with explained("services.vision"):
        robot = robot_of(config)
        with Service("vision", config, robot) as service:
            VisionNode(service, config, robot)
            service.ready()
            service.run()


if __name__ == "__main__":
    main()
