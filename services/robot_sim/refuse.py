"""What becomes of a refusal of the gate: counted when it was a message, answered when it was a call."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from bus_schema import Refused
from services.common.bus import Bus
from services.common.service import CallRefused


@contextmanager
def rejected(bus: Bus) -> Iterator[None]:
    """Count and tell it; robot_sim goes on."""
    try:
        yield
    except Refused as refused:
        bus.reject(refused.reason, str(refused))


@contextmanager
def refused_as_call() -> Iterator[None]:
    """Let the caller know."""
    try:
        yield
    except Refused as refused:
        raise CallRefused(refused.reason, str(refused)) from None
