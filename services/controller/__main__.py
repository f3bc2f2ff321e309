# SPDX-License-Identifier: Apache-2.0
"""`python -m services.controller`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.controller.config import Config
from services.controller.node import ControllerNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the controller until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.controller")
    with explained("services.controller"):
        robot = robot_of(config)
        with Service("controller", config, robot, prompt=True) as service:
            ControllerNode(service, config, robot)
            service.ready()
            service.run()


if __name__ == "__main__":
    main()
