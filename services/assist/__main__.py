# SPDX-License-Identifier: Apache-2.0
"""Starts the torso assist: `python -m services.assist`."""

from __future__ import annotations

from collections.abc import Sequence

from services.assist.config import Config
from services.assist.node import AssistNode
from services.common.service import run_node


def main(argv: Sequence[str] | None = None) -> None:
    """Run the torso assist, which moves the torso so that an arm can reach a target well, until a signal or a shutdown call."""
    run_node("services.assist", Config, AssistNode, argv)


if __name__ == "__main__":
    main()
