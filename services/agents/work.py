"""The life of an agent's process: act until it is enough, through every interruption."""

from __future__ import annotations

import time
from collections.abc import Callable

from mobee import ActionInterrupted
from services.common.bus_plant import BusPlant
from services.common.service import Service


class Work:
    """Counts the interruptions of the measurement under way."""

    def __init__(self, service: Service, plant: BusPlant) -> None:
        self._service, self._plant = service, plant
        self.interrupted = 0

    def run(self, resumed: str, enough: Callable[[], bool], step: Callable[[], None]) -> None:
        """Take steps until it is enough, and answer calls between two; `resumed`: what is gone on with, empty if nothing."""
        self._service.ready()
        if resumed:
            self._service.bus.event("info", "resumed", resumed)
        while not enough():
            try:
                step()
            except ActionInterrupted as interruption:
                self.interrupted += 1
                self._service.bus.event("warning", "interrupted", str(interruption))
            self._service.spin(time.monotonic())
        if self._service.locked:
            self._plant.leave()
