# SPDX-License-Identifier: Apache-2.0
"""The error that a verb raises when its user, or the machine, has to change something."""

from __future__ import annotations

from services.common.exit_codes import FAILED


class UserError(Exception):
    """A message for standard error, and the exit code of the command."""

    def __init__(self, text: str, code: int = FAILED) -> None:
        super().__init__(text)
        self.code = code
