# SPDX-License-Identifier: Apache-2.0
"""Starts the service `model`, which computes contacts and constraint forces: `python -m services.model`."""

from __future__ import annotations

from collections.abc import Sequence

from services.common.service import run_node
from services.model.config import Config
from services.model.node import ModelNode


def main(argv: Sequence[str] | None = None) -> None:
    """Run the service `model`, which computes contacts and constraint forces, until a signal or a shutdown call."""
    run_node("services.model", Config, ModelNode, argv, prompt=True)


if __name__ == "__main__":
    main()
