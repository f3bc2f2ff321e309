"""The life of an agent's process: acts until done, through interruptions, and publishes transitions."""

from __future__ import annotations

import time
from collections.abc import Callable

from bus_schema.messages import Transition as TransitionMessage
from mobee import ActionInterrupted
from mobee.learning.reaching.tries import Step
from mobee.learning.space import Space
from mobee.store import Transition
from services.common.bus import Publisher
from services.common.bus_plant import BusPlant
from services.common.service import Service


def tell(stream: Publisher[TransitionMessage], space: Space, n: int, made: Transition | Step, value: float) -> None:
    """Put a transition, the n-th of its agent; `value`: V(s) of the plan that it was part of."""
    stream.put(
        agent=space.part,
        n=n,
        s=made.s,
        a=made.a,
        goal=int(space.goal(made.s, made.a)),
        s_next=made.s_next,
        reward=made.reward,
        value=value,
        settled=made.settled,
        duration=made.duration,
        touched=list(made.touched),
    )


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
