"""What a verb raises when the person, or the machine, has to change something."""

from __future__ import annotations

FAILED, BAD_INPUT, ENVIRONMENT = 1, 2, 3
INTERRUPTED = 130  # as of a shell: 128 and the number of SIGINT


class UserError(Exception):
    """One line for standard error, and the exit code."""

    def __init__(self, text: str, code: int = FAILED) -> None:
        super().__init__(text)
        self.code = code
