# SPDX-License-Identifier: Apache-2.0
"""Starts the recorder: `python -m services.recorder`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from services.common.config import load_config
from services.common.entry import explained, robot_of
from services.common.service import Service
from services.common.session import spare_memory, spare_threads
from services.recorder.config import Config
from services.recorder.node import RecorderNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the recorder until a signal or a shutdown call."""
    config = load_config(Config, argv, "services.recorder")
    with explained("services.recorder"):
        record("recorder", config)


def record(who: str, config: Config, settings: Mapping[str, bytes] | None = None) -> None:
    """Record messages until a signal or a shutdown call.

    `who`: name of this service on the bus. `settings`: as those of `RecorderNode`. Raises MobeeError or BusUnreachable if the recording
    cannot begin.
    """
    config.require_folder()
    robot = robot_of(config)
    spare_threads()  # messages arrive one by one: handing each from thread to thread costs more than it
    if not config.everything:  # pictures are larger
        spare_memory()
    with Service(who, config, robot) as service:
        node = RecorderNode(service, config, robot, settings)
        service.ready()
        node.lower_priority()
        try:
            service.run()
        finally:
            node.end()


if __name__ == "__main__":
    main()
