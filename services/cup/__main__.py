# SPDX-License-Identifier: Apache-2.0
"""Starts the service that fetches the cup: `python -m services.cup`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.cup.config import Config
from services.cup.node import CupNode


def main(argv: Sequence[str] | None = None) -> None:
    """Fetch the cup and put it down elsewhere, until this was done as often as configured, or until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.cup")
    with explained("services.cup"):
        robot = robot_of(config)
        with Service("cup", config, robot) as service:
            CupNode(service, config, robot).run()


if __name__ == "__main__":
    main()
