# SPDX-License-Identifier: Apache-2.0
"""Text from messages and files, made safe for a terminal or a log."""

from __future__ import annotations

_ESCAPED = {code: f"\\x{code:02x}" for code in (*range(0x20), *range(0x7F, 0xA0))} | {0x2028: "\\u2028", 0x2029: "\\u2029"}


def printable(text: str) -> str:
    """Return the text with its control characters escaped, so that it is one line and moves no cursor."""
    return text.translate(_ESCAPED)
