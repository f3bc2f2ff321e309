# SPDX-License-Identifier: Apache-2.0
"""`python -m services.model`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.model.config import Config
from services.model.node import ModelNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the model until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.model")
    with explained("services.model"):
        robot = robot_of(config)
        with Service("model", config, robot, prompt=True) as service:
            ModelNode(service, config, robot)
            service.ready()
            service.run()


if __name__ == "__main__":
    main()
