# SPDX-License-Identifier: Apache-2.0
"""Starts the gaze, the service that points the cameras at a target: `python -m services.gaze`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.service import run_node
from services.gaze.config import Config
from services.gaze.node import GazeNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the gaze until a signal or a shutdown call."""
    run_node("services.gaze", Config, GazeNode, argv)


if __name__ == "__main__":
    main()
