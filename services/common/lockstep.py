# SPDX-License-Identifier: Apache-2.0
"""Lockstep: tick k + 1 begins when all participants have answered tick k (docs/bus.md).

A participant (service for which every tick waits) has a `Participant`, and calls `done(k)` after it has published all its messages for
tick k. robot_sim, which publishes the ticks, waits with a `Barrier`; so does the port filter for its clients. In free mode the ticks
follow real time, and `done` does nothing.
"""

from __future__ import annotations

import os
import random
import time
from collections.abc import Callable, Iterable, Sequence

from bus_schema.messages import Answer, StepDone, Turn
from services.common.service import Service

TEST_DELAY = "MOBEE_TEST_DELAY_MS"  # environment variable: longest random sleep [ms] of a participant, at every tick and before its answer


class Participant:
    """Sends robot_sim a service's answers to ticks in lockstep, in which every tick waits for all participants.

    In free mode, in which the ticks follow real time, it does nothing.
    """

    def __init__(self, service: Service) -> None:
        self._locked = service.keeps_step = service.locked
        self._delay = float(os.environ.get(TEST_DELAY, "0")) * 1e-3  # s
        if self._locked:
            service.inject_test_delay = self.inject_test_delay
            self._done = service.bus.publisher(StepDone, service.who)

    def done(
        self, k: int, *, ok: bool = True, busy: Sequence[str] = (), last: bool = False, including: Sequence[str] = (), implied: bool = False
    ) -> None:
        """Publish that this service has sent all its messages for tick k (`StepDone`). In free mode this does nothing.

        `ok`: False if an input was missing, so that the run is not repeatable. `busy`: names of services that have nothing to decide in
        this tick; only the controller sets it. `last`: True if the service leaves lockstep. `including`: names of participants whose
        messages for this tick this service has used; these need not answer the tick themselves. `implied`: True: publish nothing, because
        another service will name this service in its `including`.
        """
        if not self._locked:
            return
        self.inject_test_delay()
        if not implied:
            self._done.put(re_k=k, ok=ok, busy=list(busy), last=last, including=list(including))

    def inject_test_delay(self) -> None:
        """Sleep for a random time of at most MOBEE_TEST_DELAY_MS (environment variable) ms, to test that delays change no result."""
        if self._delay:
            time.sleep(random.uniform(0.0, self._delay))  # not seeded, like a scheduler


class Barrier:
    """The participants that must answer a tick in lockstep, and their answers.

    A tick waits only for participants that are present. A participant is present from its first answer on. It is absent when its liveliness
    token has disappeared, when it has not answered within `patience` [s] of real time, or when it has left lockstep. If it answers again,
    it is present again. The answer of the controller (`referee`) to a tick lists participants that are busy with an action: these need not
    answer this tick. All others get a `Turn` message after the controller's answer. An agent can therefore wait for `Turn` messages, and
    need not read every tick. `report(participant, reason)` is called when the run is no longer repeatable.
    """

    def __init__(
        self,
        service: Service,
        participants: Iterable[str],
        report: Callable[[str, str], None],
        referee: str = "controller",
        patience: float = 2.0,
    ) -> None:
        """Subscribe to the answers of the participants to the ticks (`StepDone` messages).

        `participants`: names of the services that are expected. `report`: called with (participant, reason) when the run is no longer
        repeatable. `referee`: the service whose answers list busy participants. `patience`: s of real time for one tick; a participant that
        has not answered by then is dropped.
        """
        self._service, self._report, self._referee, self._patience = service, report, referee, patience
        self._expected = set(participants)
        self._present: set[str] = set()
        self._answered: dict[str, int] = {}  # newest tick that each has answered
        self._busy: Sequence[str] = ()  # of the referee's newest answer
        self._turns = {who: service.bus.publisher(Turn, who) for who in sorted(self._expected - {referee})}
        service.on_each(StepDone, self._note_done)
        service.on_alive(self._note_alive)

    def begin(self) -> None:
        """Start a new run, in which no participant is present yet."""
        self._present.clear()
        self._answered.clear()

    def absent(self) -> list[str]:
        """Return the expected participants that are not present."""
        return sorted(self._expected - self._present)

    def is_empty(self) -> bool:
        """Return whether no participant is present, so that no tick waits."""
        return not self._present

    def missing(self, k: int) -> list[str]:
        """Return the names of the present participants that must still answer tick k.

        When the controller (`referee`) has answered this tick, the participants that it lists as busy need not answer.
        """
        waiting = {who for who in self._present if self._answered.get(who, -1) < k}
        if waiting and self._referee not in waiting and self._answered.get(self._referee) == k:
            waiting.difference_update(self._busy)
        return sorted(waiting)

    def wait(self, k: int) -> list[str]:
        """Handle messages until all present participants have answered tick k, for at most `patience` s of real time.

        Those that have not answered then are dropped, and their names are returned.
        """
        if self._referee not in self._present:
            self._give_turns(())
        self._service.spin(time.monotonic() + self._patience, lambda: not self.missing(k))
        late = self.missing(k)
        for who in late:
            self._drop(who, f"did not answer tick {k} within {self._patience:g} s")
        return late

    def _drop(self, who: str, why: str) -> None:
        if who in self._present:
            self._present.discard(who)
            self._report(who, why)
            if who == self._referee:
                self._give_turns(())

    def _give_turns(self, busy: Sequence[str]) -> None:
        k = self._service.bus.k
        for who, turn in self._turns.items():
            if k == 0 or (who not in busy and self._answered.get(who, -1) < k):
                turn.put(dt=self._service.bus.dt)

    def note(self, who: str, re_k: int, answer: Answer) -> None:
        """Record the answer of the participant `who` to tick `re_k`.

        `answer.including`: names of participants whose messages for this tick `who` has used; the tick counts as answered by these too.
        """
        for one in (who, *answer.including):
            self._answered[one] = re_k
            self._present.add(one)
        if who == self._referee and re_k == self._service.bus.k:
            self._busy = answer.busy
            self._give_turns(answer.busy)
        if not answer.ok:
            self._report(who, f"lacked an input at tick {re_k}")

    def _note_done(self, done: StepDone) -> None:
        if done.last:
            self._present.discard(done.src)
            self._expected.discard(done.src)
        else:
            self.note(done.src, done.re_k, Answer(done.ok, done.busy, done.including))

    def _note_alive(self, who: str, instance: str, up: bool) -> None:
        if not up and not self._service.alive.get(who):
            self._drop(who, "is gone")
