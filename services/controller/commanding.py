"""The controller's commands; in lockstep also its answer to the tick, in the same message wherever that can be."""

from __future__ import annotations

from collections.abc import Mapping

from bus_schema import keys
from bus_schema.chain import Answer, Commands, Order, Tick
from bus_schema.messages import Forces
from mobee.robot.robot import Array
from services.common.lockstep import Participant
from services.common.service import Service
from services.controller.action import Action, busy_owners
from services.controller.drives import Drives


class Commanding:
    """One message a tick to all parts that obey."""

    def __init__(self, service: Service, ttl: int, actions: Mapping[str, Action], drives: Drives) -> None:
        self._ttl, self._actions, self._drives = ttl, actions, drives
        self._commands = service.bus.publisher(keys.COMMANDS, Commands, service.bus.control)
        self._participant = Participant(service)
        self._to_answer: tuple[int, Answer] | None = None  # lockstep: a tick, and what will be said to it
        drives.answered = self._answer

    def forget(self) -> None:
        """A new tick, or a new run: what was not answered yet never will be."""
        self._to_answer = None

    def command(self, k: int, orders: dict[str, Order], reference: Array, answer: Answer | None = None) -> None:
        """Tick k's orders, if there are any; reference (n,) of the modality."""
        if orders:
            self._commands.put(re_k=k, parts=orders, ref=reference.tolist(), ttl=self._ttl, answer=answer)

    def close(self, tick: Tick, forces: Forces | None, fresh: bool, orders: dict[str, Order], reference: Array) -> None:
        """Lockstep: command, and answer the tick in the same message unless a part is being armed; tick 0 when all has begun."""
        if tick.k == 0 and not (fresh and self._has_begun(tick)):
            return
        including = [forces.src] if forces is not None and forces.re_k == tick.k else []
        answer = Answer(fresh, busy_owners(self._actions.values()), including)
        self._to_answer = tick.k, answer
        if tick.k == 0 or not orders or self._drives.asking:
            self.command(tick.k, orders, reference)
            self._answer()
            return
        self._participant.dawdle()
        self.command(tick.k, orders, reference, answer)
        self._to_answer = None

    def _has_begun(self, tick: Tick) -> bool:
        """Tick 0: whether all is under control that can be, and somebody hears the commands."""
        ready = (self._drives.armed(part, state) or not self._drives.can_arm(state) for part, state in tick.parts.items())
        return all(ready) and self._commands.heard

    def _answer(self) -> None:
        """The tick is answered when no part is being armed any more."""
        if self._to_answer is not None and not self._drives.asking:
            (k, answer), self._to_answer = self._to_answer, None
            busy = busy_owners(self._actions.values())
            self._participant.done(k, ok=answer.ok, busy=busy, including=answer.including)
