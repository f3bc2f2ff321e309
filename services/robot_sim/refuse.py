"""What becomes of a refusal of the gate when it was a call: an answer."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bus_schema import Refused
from services.common.service import CallRefused


@contextmanager
def refused_as_call() -> Iterator[None]:
    """Let the caller know."""
    try:
        yield
    except Refused as refused:
        raise CallRefused(refused.reason, str(refused)) from None
