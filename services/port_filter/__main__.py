# SPDX-License-Identifier: Apache-2.0
"""Starts the port filter, which moves the robot back if a client moves it into contact: `python -m services.port_filter`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import ServiceConfig, load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.port_filter.config import Config
from services.port_filter.node import FilterNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the port filter, which moves the robot back when a client moves it into contact, until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.port_filter")
    with explained("services.port_filter"):
        robot = robot_of(config)
        theirs = ServiceConfig(endpoint=config.endpoint, namespace=config.clients, robot=config.robot, mode=config.mode)
        with Service("robot_sim", theirs, robot) as twin, Service("port_filter", config, robot, inbox=twin.inbox) as service:
            twin.log.disabled = True  # its events are for the clients; the service logs them for people
            FilterNode(service, twin, config, robot)
            service.ready()
            twin.ready()
            service.run()


if __name__ == "__main__":
    main()
