"""Lockstep: tick k + 1 begins when all participants have answered tick k (docs/bus.md).

A participant keeps a `Participant` and says `done(k)` when all that it has to say to tick k is put; whoever owns the clock waits at a
`Barrier`.  In free mode `done` says nothing.
"""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable, Iterable, Sequence

from bus_schema.messages import Answer, StepDone, Turn
from services.common.service import Service

TEST_DELAY = "MOBEE_TEST_DELAY_MS"  # environment: a participant sleeps up to so long at every tick and again before it answers


class Participant:
    """One who answers every tick, or every tick at which there is something to decide."""

    def __init__(self, service: Service) -> None:
        self._locked = service.keeps_step = service.locked
        self._delay = float(os.environ.get(TEST_DELAY, "0")) * 1e-3  # s
        if self._locked:
            service.inject_test_delay = self.inject_test_delay
            self._done = service.bus.publisher(StepDone, service.who)

    def done(
        self, k: int, *, ok: bool = True, busy: Sequence[str] = (), last: bool = False, including: Sequence[str] = (), told: bool = False
    ) -> None:
        """All that this service has to say to tick k is put; see StepDone for the rest.

        `told`: somebody else will say so, in whose answer this one is included.
        """
        if not self._locked:
            return
        self.inject_test_delay()
        if not told:
            self._done.put(re_k=k, ok=ok, busy=list(busy), last=last, including=list(including))

    def inject_test_delay(self) -> None:
        """Be late, in tests that ask for it: before every answer."""
        if self._delay:
            time.sleep(random.uniform(0.0, self._delay))  # not seeded: it stands for the scheduler


class Barrier:
    """Who must answer, and who has.

    A participant counts from its first answer on until its token goes, until it is dropped for being late, or until its last
    answer; when it answers again it counts again.  Who is named busy by the controller's answer need not answer that tick; the
    others are told by then that it is their turn, so that an agent need not listen to every tick.
    """

    def __init__(
        self,
        service: Service,
        participants: Iterable[str],
        tell: Callable[[str, str], None],
        referee: str = "controller",
        patience: float = 2.0,
    ) -> None:
        """`tell` hears (who, why) of all that makes a run one that cannot be repeated; `referee` says who is busy.

        `patience`: s of the clock on the wall for one tick; who has not answered then is out.
        """
        self._service, self._tell, self._referee, self._patience = service, tell, referee, patience
        self._expected = set(participants)
        self._present: set[str] = set()
        self._answered: dict[str, int] = {}  # newest tick that each has answered
        self._busy: Sequence[str] = ()  # of the referee's newest answer
        self._turns = {who: service.bus.publisher(Turn, who) for who in sorted(self._expected - {referee})}
        service.on_each(StepDone, self._note_done)
        service.on_alive(self._note_alive)

    def begin(self) -> None:
        """A new run: everybody has to come anew."""
        self._present.clear()
        self._answered.clear()

    def absent(self) -> list[str]:
        """Who is expected and does not take part (yet)."""
        return sorted(self._expected - self._present)

    def missing(self, k: int) -> list[str]:
        """Who must still answer tick k."""
        waiting = {who for who in self._present if self._answered.get(who, -1) < k}
        if waiting and self._referee not in waiting and self._answered.get(self._referee) == k:
            waiting.difference_update(self._busy)
        return sorted(waiting)

    def wait(self, k: int) -> list[str]:
        """Handle what comes until tick k is answered by all, or until those who have not are late: these are dropped, and named."""
        if self._referee not in self._present:
            self._give_turns(())
        self._service.spin(time.monotonic() + self._patience, lambda: not self.missing(k))
        late = self.missing(k)
        for who in late:
            self._drop(who, f"has not answered tick {k} within {self._patience:g} s")
        return late

    def _drop(self, who: str, why: str) -> None:
        if who in self._present:
            self._present.discard(who)
            self._tell(who, why)
            if who == self._referee:
                self._give_turns(())

    def _give_turns(self, busy: Sequence[str]) -> None:
        k = self._service.bus.k
        for who, turn in self._turns.items():
            if k == 0 or (who not in busy and self._answered.get(who, -1) < k):
                turn.put(dt=self._service.bus.dt)

    def note(self, who: str, re_k: int, answer: Answer) -> None:
        """Somebody has answered tick re_k, and with that those whose answers are included."""
        for one in (who, *answer.including):
            self._answered[one] = re_k
            self._present.add(one)
        if who == self._referee and re_k == self._service.bus.k:
            self._busy = answer.busy
            self._give_turns(answer.busy)
        if not answer.ok:
            self._tell(who, f"lacked something at tick {re_k}")

    def _note_done(self, done: StepDone) -> None:
        if done.last:
            self._present.discard(done.src)
            self._expected.discard(done.src)
        else:
            self.note(done.src, done.re_k, Answer(done.ok, done.busy, done.including))

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if not up and not self._service.alive.get(who):
            self._drop(who, "is gone")
