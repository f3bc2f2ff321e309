# SPDX-License-Identifier: Apache-2.0
"""Subscriptions of a service, whose handlers run in its main thread."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable
from time import monotonic
from typing import Any, TypeVar

import zenoh
import zenoh.ext
from zenoh.handlers import Callback

from bus_schema.messages import Clock, Message, Tick, Turn
from services.common.bus import NO_RUN, Bus, part_of
from services.common.health import Health
from services.common.inbox import CROWDED, Inbox, Newest

_M = TypeVar("_M", bound=Message)
_T = TypeVar("_T", Clock, Tick, Turn)
MAX_CLOCK_RATE = 100.0  # messages per second of real time on `clock` in free mode; `tick` has every tick
_known = threading.local()  # lives as long as Python knows the thread


class Listener:
    """Subscribes a process to streams, and handles their messages in the main thread of the process."""

    def __init__(self, bus: Bus, inbox: Inbox, locked: bool, direct: bool) -> None:
        """`locked`: in lockstep (every tick waits for all participants).

        `direct`: Zenoh's own thread puts messages into the inbox, without a thread of Python for each subscription.
        """
        self.bus, self.inbox, self.locked, self._direct = bus, inbox, locked, direct
        self.keeps_step = False  # set by a Participant in lockstep
        self.inject_test_delay: Callable[[], None] = lambda: None  # called before every tick, for tests of lockstep
        bus.control = "STEP" if locked else "LATEST"
        self.health = Health()
        self.expected_rate: float | None = None  # of the ticks that it gets or makes, Hz of real time; None: they have no fixed rate
        self._beats_of: type[Message] | None = None  # the stream that gives the rate
        self._kept: list[Any] = []  # handles of tokens and subscriptions, which end with them
        self._on_run: list[Callable[[], None]] = []
        self._early: list[Callable[[], None]] = []  # handlers of past messages that came before the first clock message

    def on_newest(self, cls: type[_M], handler: Callable[[_M], None], name: str = "*", *, any_run: bool = False) -> None:
        """Call `handler` with the newest message of a stream; a message that still waits is replaced by a newer one.

        In lockstep (every tick waits for the answers of all participants) a participant handles every message instead. `name`: value of the
        variable in the stream's key, such as the name of a part; "*": all values. `any_run`: True: accept also messages of other runs of
        robot_sim; False: refuse them.
        """
        part = part_of(cls, name)
        self._subscribe(cls.stream.keys(name), self._newest(lambda sample: self._deliver(cls, sample, handler, part, any_run)))

    def on_each(
        self,
        cls: type[_M],
        handler: Callable[[_M], None],
        name: str = "*",
        *,
        history: bool = False,
        any_run: bool = False,
        crowd: int = CROWDED,
        later: bool = False,
    ) -> None:
        """Call `handler` with every message of a stream.

        Args:
            cls: type of the messages.
            handler: called in the main thread.
            name: value of the variable in the stream's key, such as the name of a part; "*": all values.
            history: also handle messages that were published before this service subscribed, as soon as it knows the present run of
                robot_sim.
            any_run: True: accept also messages of other runs of robot_sim; False: refuse them.
            crowd: if so many handlers wait in the inbox, new messages of this stream are dropped. With `later`, only messages that were
                queued with `later` are included in this number.
            later: True: messages of this stream do not wake the main thread. They wait, and are handled just before the next message of
                another stream.
        """
        key, part = cls.stream.keys(name), part_of(cls, name)

        def deliver(sample: zenoh.Sample) -> None:
            if history and not any_run and self.bus.run == NO_RUN:
                self._early.append(lambda: self._deliver(cls, sample, handler, part))
            else:
                self._deliver(cls, sample, handler, part, any_run)

        def enqueue(sample: zenoh.Sample) -> None:
            offer = self.inbox.offer_later if later else self.inbox.offer
            offer(lambda: deliver(sample), crowd)

        if history:
            settings = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            self._kept.append(zenoh.ext.declare_advanced_subscriber(self.bus.session, key, enqueue, history=settings))
        else:
            self._subscribe(key, enqueue)

    def _newest(self, handle: Callable[[zenoh.Sample], None]) -> Callable[[zenoh.Sample], None]:
        """Return a callback that handles only the newest sample (received message) of a stream.

        A sample that is not handled yet is replaced by a newer one. In lockstep every sample is handled, in the order of arrival: with
        replacements, samples of two streams could be handled in another order.
        """
        slot = Newest(self.inbox, handle)

        def offer(sample: zenoh.Sample) -> None:
            if self.keeps_step:
                self.inbox.handle(lambda: handle(sample))
            else:
                slot.offer(sample)

        return offer

    def _subscribe(self, key: str, offer: Callable[[zenoh.Sample], None]) -> None:
        """Subscribe to a key of the bus and call `offer` with each sample (received message).

        With the service's setting `direct`, Zenoh's own thread calls it. Without it, each subscription has a thread of Python: this costs
        time, and could change the order of two streams in lockstep.
        """
        self._kept.append(self.bus.session.declare_subscriber(key, Callback(stay_known(offer), indirect=False) if self._direct else offer))

    def on_clock(self, handler: Callable[[Clock], None]) -> None:
        """Call `handler` with the newest `Clock` message.

        At the first message of a run of robot_sim, the handlers of `on_run` are called before `handler`.
        """
        self._on_time(Clock, handler)

    def on_tick(self, handler: Callable[[Tick], None]) -> None:
        """Call `handler` with the newest `Tick` message: the start of a tick, with the newest state of every part."""
        self._on_time(Tick, handler)

    def on_turn(self, handler: Callable[[Turn], None]) -> None:
        """Call `handler` with each `Turn` message for this service, a request to answer the present tick.

        Use this in lockstep (every tick waits for the answers of all participants) instead of `on_clock` if the service needs only the
        ticks that wait for its own answer.
        """
        self._on_time(Turn, handler, self.bus.who)

    def _note_beat(self, time: Clock | Tick | Turn) -> None:
        self.health.beats.note(monotonic())
        if isinstance(time, Clock):  # a Tick is one too
            rate = 1e9 * time.rate / time.dt
            every = 1 if isinstance(time, Tick) else max(1, round(rate / MAX_CLOCK_RATE))
            self.expected_rate = rate / every if time.mode == "free" else None

    def _on_time(self, cls: type[_T], handler: Callable[[_T], None], name: str = "*") -> None:
        if self._beats_of is None or cls is Tick:
            self._beats_of = cls

        def handle(sample: zenoh.Sample) -> None:
            time = self.bus.receive(cls, sample, any_run=True)
            if time is None:
                return
            if cls is self._beats_of:
                self._note_beat(time)
            self.inject_test_delay()
            self.bus.note_time(time)
            if time.run != self.bus.run:
                known, self.bus.run = self.bus.run, time.run
                if known != NO_RUN:
                    self.bus.event("warning", "new_run", f"robot_sim started run {time.run} after {known}")
                for announce in self._on_run:
                    announce()
                early, self._early = self._early, []
                for handle_early in early:
                    handle_early()
            self.bus.guarded(cls.__name__, lambda: handler(time))

        self._subscribe(cls.stream.keys(name), self._newest(handle))

    def on_run(self, handler: Callable[[], None]) -> None:
        """Call `handler` at the first tick of every run of robot_sim."""
        self._on_run.append(handler)

    def _deliver(self, cls: type[_M], sample: zenoh.Sample, handler: Callable[[_M], None], part: str | None, any_run: bool = False) -> None:
        message = self.bus.receive(cls, sample, part, any_run=any_run)
        if message is not None:
            self.bus.guarded(cls.__name__, lambda: handler(message))


def stay_known(offer: Callable[[zenoh.Sample], None]) -> Callable[[zenoh.Sample], None]:
    """Return a callback that calls `offer`, and that threads of Zenoh can call at less cost.

    Python normally allocates a thread state for each call from a thread of Zenoh, and frees it when the call ends, which costs more than
    the callback itself. The returned callback claims the state at its first call in a thread, and never releases it.
    """

    def call(sample: zenoh.Sample) -> None:
        if not hasattr(_known, "claim"):
            _known.claim = ctypes.pythonapi.PyGILState_Ensure()
        offer(sample)

    return call
