# SPDX-License-Identifier: Apache-2.0
"""Starts the simulated robot: `python -m services.robot_sim`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.robot_sim.config import Config
from services.robot_sim.make import make_backend
from services.robot_sim.node import Node


def main(argv: Sequence[str] | None = None) -> None:
    """Run the simulated robot until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.robot_sim")
    with explained("services.robot_sim"):
        robot = robot_of(config)
        backend = make_backend(config, robot)
        with Service("robot_sim", config, robot, prompt=True) as service:
            node = Node(service, config, robot, backend)
            service.ready()
            node.run()


if __name__ == "__main__":
    main()
