"""The newest that every part has said."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from bus_schema.messages import Message
from mobee.robot.robot import Robot
from services.common.service import Service

_M = TypeVar("_M", bound=Message)


class PartStreams(Generic[_M]):
    """One stream of each part; in lockstep `newest` is what holds at the tick whose turn it is."""

    def __init__(self, service: Service, robot: Robot, key: Callable[[str], str], cls: type[_M]) -> None:
        self.newest: dict[str, _M] = {}
        self._parts = len(robot.parts)
        for part in robot.parts:
            service.on_newest(key(part), cls, self._noter(part), part=part)
        service.on_run(self.newest.clear)

    def are_complete(self) -> bool:
        """Whether every part has said something in this run."""
        return len(self.newest) == self._parts

    def _noter(self, part: str) -> Callable[[_M], None]:
        def note(message: _M) -> None:
            self.newest[part] = message

        return note
