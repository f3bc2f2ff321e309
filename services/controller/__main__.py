# SPDX-License-Identifier: Apache-2.0
"""Starts the controller: `python -m services.controller`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.service import run_node
from services.controller.config import Config
from services.controller.node import ControllerNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the controller until a signal or a shutdown call."""
    run_node("services.controller", Config, ControllerNode, argv, prompt=True)


if __name__ == "__main__":
    main()
