# SPDX-License-Identifier: Apache-2.0
"""Starts the performer, a service that calls a function of an experiment: `python -m experiments.kit.live.performer`."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from pathlib import Path

from bus_schema import keys
from bus_schema.rpc import Done, Empty
from experiments.kit.live.performer.config import Config
from mobee import load_robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import Service


def main(argv: Sequence[str] | None = None) -> None:
    """Call the function that the settings name, then ask the launcher to shut the system down.

    `argv`: arguments of the command line; None: those of the process.
    """
    config = load_config(Config, argv, "experiments.kit.live.performer")
    module, _, function = config.perform.partition(":")
    with explained(config.perform):
        perform = getattr(importlib.import_module(module), function)
        with Service("performer", config, load_robot(config.robot)) as service:
            perform(service, Path(config.run_dir))
            service.call(keys.service_rpc("launcher", "shutdown"), Empty, Done, tries=3)
            service.run()


if __name__ == "__main__":
    main()
