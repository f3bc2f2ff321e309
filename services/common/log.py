"""One log format: time, level, service, text; to standard error, which the launcher keeps in a file a service."""

from __future__ import annotations

import logging
import sys


def set_up(who: str) -> logging.Logger:
    """The service's logger."""
    logging.basicConfig(
        stream=sys.stderr,
        level=logging.INFO,
        format=f"%(asctime)s.%(msecs)03d %(levelname)-7s {who} %(message)s",
        datefmt="%H:%M:%S",
        force=True,
    )
    return logging.getLogger(who)
