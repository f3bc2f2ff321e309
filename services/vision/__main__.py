# SPDX-License-Identifier: Apache-2.0
"""Starts the locator, which finds things in the pictures of two cameras: `python -m services.vision`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.service import run_node
from services.vision.config import Config
from services.vision.node import VisionNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the locator, which finds things in the pictures of two cameras, until a signal or a shutdown call."""
    run_node("services.vision", Config, VisionNode, argv)


if __name__ == "__main__":
    main()
