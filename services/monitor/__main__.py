# SPDX-License-Identifier: Apache-2.0
"""Starts the monitor: `python -m services.monitor`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.monitor.config import Config
from services.monitor.node import MonitorNode
from services.monitor.viewer.output import open_output

LAST_WORDS = 1.0  # s for which the end waits until open pages have shown that the system has ended; the launcher waits for twice that


def main(argv: Sequence[str] | None = None) -> None:
    """Run the monitor until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.monitor")
    with explained("services.monitor"):
        robot = robot_of(config)
        nodes: list[MonitorNode] = []
        with (
            open_output(config, robot, lambda: nodes[0].now if nodes else 0.0) as output,
            Service("monitor", config, robot) as service,
        ):
            nodes.append(MonitorNode(service, config, robot, output))
            service.ready()
            try:
                service.run()
            finally:
                nodes[0].end()
                if output.server is not None:
                    output.server.let_pages_show(LAST_WORDS)


if __name__ == "__main__":
    main()
