# SPDX-License-Identifier: Apache-2.0
"""The commands of docker/compose.yaml, as they stand there and as plain processes of this machine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import yaml

COMPOSE = Path(__file__).parents[2] / "docker" / "compose.yaml"
INTERPRETERS = {"python": [sys.executable], "mobee": [sys.executable, "-m", "mobee_cli"]}
ROUTER = ("tcp/router:7447", "tcp/0.0.0.0:7447")


def load_compose() -> dict[str, Any]:
    return yaml.safe_load(COMPOSE.read_text())


def compose_commands() -> dict[str, list[str]]:
    """Service name -> command as the container would run it."""
    return {name: service["command"] for name, service in load_compose()["services"].items()}


def as_processes(port: int) -> dict[str, list[str]]:
    """Service name -> argv that runs it here, all of them around a router at 127.0.0.1:`port`; the router comes first.

    The processes write below their working directory, as the containers do; the page stays on loopback.
    """
    here = dict.fromkeys(ROUTER, f"tcp/127.0.0.1:{port}") | {"0.0.0.0": "127.0.0.1"}
    return {name: INTERPRETERS[command[0]] + [here.get(word, word) for word in command[1:]] for name, command in compose_commands().items()}
