# SPDX-License-Identifier: Apache-2.0
"""`python -m services.monitor`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.monitor.blueprint import blueprint, shown_of
from services.monitor.config import Config
from services.monitor.node import MonitorNode
from services.monitor.output import open_output, recording_of


def main(argv: Sequence[str] | None = None) -> None:
    """Run the monitor until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.monitor")
    with explained("services.monitor"):
        robot = robot_of(config)
        with (
            open_output(config, blueprint(shown_of(robot), config.page), recording_of(config)) as output,
            Service("monitor", config, robot) as service,
        ):
            MonitorNode(service, config, robot, output)
            service.ready()
            service.run()


if __name__ == "__main__":
    main()
