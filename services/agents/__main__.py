# SPDX-License-Identifier: Apache-2.0
"""Starts an agent: `python -m services.agents --part left_arm`."""

from __future__ import annotations

from collections.abc import Sequence

from services.agents.config import Config
from services.agents.node import AgentNode, ReachNode
from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service


def main(argv: Sequence[str] | None = None) -> None:
    """Run an agent until it is stopped, or has made the configured number of transitions, or of attempts to reach a target."""
    config = load_config(Config, argv, "services.agents")
    with explained("services.agents"):
        robot = robot_of(config)
        robot.part(config.part)
        with Service(f"agent_{config.part}", config, robot) as service:
            (ReachNode if config.targets else AgentNode)(service, config, robot).run()


if __name__ == "__main__":
    main()
