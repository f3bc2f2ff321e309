# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import Literal

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """How the toy behaves."""

    name: str = "toy"
    """Its name on the bus."""
    behaviour: Literal[
        "healthy", "talk", "crash_at_start", "crash_once_ready", "bad_settings", "freeze", "hang", "backlog", "starve", "deaf", "finish"
    ] = "healthy"
    """What goes wrong."""
    delay: float = 0.3
    """Seconds from ready to what goes wrong."""
    gains: Literal["default", "published_2014"] = "default"
    """A word out of few."""
    run_dir: str = ""
    """Folder of the run."""
