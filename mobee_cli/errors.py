# SPDX-License-Identifier: Apache-2.0
"""The error that ends a subcommand of `mobee` if its input is wrong, its task fails, or the machine has a fault."""

from __future__ import annotations

from services.common.exit_codes import FAILED


class UserError(Exception):
    """Raised to end a verb (subcommand of `mobee`). The text is printed on standard error; `code` is the exit code of the command."""

    def __init__(self, text: str, code: int = FAILED) -> None:
        super().__init__(text)
        self.code = code
