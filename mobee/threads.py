"""How many threads share a piece of work."""

from __future__ import annotations

from mobee.errors import InvalidValue

MOST = 1024


def checked_threads(threads: int) -> int:
    """The number of threads; raises InvalidValue if it is none."""
    if isinstance(threads, bool) or not isinstance(threads, int) or not 1 <= threads <= MOST:
        raise InvalidValue(f"threads={threads!r}: give a whole number from 1 to {MOST}.")
    return threads
