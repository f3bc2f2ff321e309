"""What every part says of one and the same tick."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from bus_schema.messages import Clock, Message
from services.common.service import Service

_M = TypeVar("_M", bound=Message)


class PartsOfTick(Generic[_M]):
    """Calls `ready(clock)` once a tick, when the clock and a message of every part are there.

    In lockstep no message of a tick comes after the next clock, so nothing depends on which of them comes first.
    """

    def __init__(
        self, service: Service, parts: tuple[str, ...], key: Callable[[str], str], cls: type[_M], ready: Callable[[Clock], None]
    ) -> None:
        self.newest: dict[str, _M] = {}
        self._parts, self._ready = parts, ready
        self._clock: Clock | None = None  # of the tick that is not complete yet
        for part in parts:
            service.on_newest(key(part), cls, self._noter(part), part=part)
        service.on_run(self.newest.clear)
        service.on_clock(self._tick)

    def _noter(self, part: str) -> Callable[[_M], None]:
        def note(message: _M) -> None:
            self.newest[part] = message
            self._look()

        return note

    def _tick(self, clock: Clock) -> None:
        self._clock = clock if clock.mode != "paused" else None
        self._look()

    def _look(self) -> None:
        clock = self._clock
        if clock is None or len(self.newest) < len(self._parts) or min(message.k for message in self.newest.values()) < clock.k:
            return
        self._clock = None
        self._ready(clock)
