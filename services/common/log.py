"""Log format: time, level, service, text; to standard error, which the launcher keeps in a file for each service."""

from __future__ import annotations

import logging
import sys
from pathlib import Path


class _ToFile(logging.FileHandler):
    """A file of log lines."""

    def handleError(self, record: logging.LogRecord) -> None:
        """A line that the disk has no room for is lost: told without logging's traceback, which would cover the screen."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handleError(record)


def set_up(who: str, file: Path | None = None) -> logging.Logger:
    """The service's logger; `file` instead of standard error."""
    logging.basicConfig(
        handlers=[logging.StreamHandler(sys.stderr) if file is None else _ToFile(file)],
        level=logging.INFO,
        format=f"%(asctime)s.%(msecs)03d %(levelname)-7s {who} %(message)s",
        datefmt="%H:%M:%S",
        force=True,
    )
    return logging.getLogger(who)
