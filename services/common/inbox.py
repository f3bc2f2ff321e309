# SPDX-License-Identifier: Apache-2.0
"""The inbox of a process: Zenoh's threads put messages in, the main thread handles them."""

from __future__ import annotations

import heapq
import itertools
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Any, NoReturn

Handler = Callable[[], None]
CROWDED = 1000  # waiting messages and calls at which further messages are dropped
CROWDED_WITH_CALLS = 2 * CROWDED  # the same for calls: a service must answer calls during a flood of messages
CROWDED_WITH_STOPS = 2 * CROWDED_WITH_CALLS  # the same for emergency stops: only a flood of stops reaches this number
GRACE = 0.002  # s for which `spin` handles waiting messages after its time is over


class Newest:
    """A slot for the newest sample (received message) of a stream. A new sample replaces one that was not handled yet.

    The inbox therefore contains at most one handler of the stream.
    """

    def __init__(self, inbox: Inbox, handle: Callable[[Any], None]) -> None:
        self._inbox, self._handle, self._lock = inbox, handle, Lock()
        self._sample: Any = None

    def offer(self, sample: Any) -> None:
        """Store a sample (received message), and queue its handler in the inbox if it is not queued yet; Zenoh's thread calls this."""
        with self._lock:
            waiting, self._sample = self._sample is not None, sample
        if not waiting:
            self._inbox.put(self._run)

    def _run(self) -> None:
        with self._lock:
            sample, self._sample = self._sample, None
        self._handle(sample)


class Timer:
    """A handler that will be called at a given time unless it is cancelled before."""

    def __init__(self, handle: Handler) -> None:
        self.handle: Handler | None = handle

    def cancel(self) -> None:
        """Cancel the call of the handler; the process then does not wake up for it. Call this only from a handler."""
        self.handle = None


class Inbox:
    """A queue of handlers, in the order of arrival, and timers; the main thread runs both.

    A `queue.SimpleQueue` is not used: in CPython 3.11, its `get(timeout)` can block without limit if the timeout is over just when it
    begins to wait.
    """

    def __init__(self) -> None:
        self._queue: deque[Handler] = deque()
        self._signal = Lock()  # released to wake the main thread
        self._signal.acquire()
        self._later: deque[Handler] = deque()
        self._timers: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()
        self._turn = Lock()  # held by the thread that runs handlers: the main thread, except while it waits in `serve`
        self._turn.acquire()
        self._serves = False
        self.dropped = 0  # number of messages and calls dropped because too many were waiting
        self.handled = 0  # number of messages, calls and timers whose handler has run

    def put(self, handler: Handler) -> None:
        """Queue a handler for the main thread; any thread may call this."""
        self._queue.append(handler)
        self._wake()

    def handle(self, handler: Handler) -> None:
        """Run the handler in the calling thread if the main thread waits in `serve` and no handler is queued; otherwise queue the handler.

        An exception of the handler is raised in the main thread.
        """
        if not self._turn.acquire(blocking=False):
            self.put(handler)
            return
        try:
            if not self._queue:
                self._run(handler)
            else:
                self.put(handler)
        except BaseException as error:  # this is another library's thread: the main thread must raise it
            self.put(partial(_raise, error))
        finally:
            self._turn.release()

    def waiting(self) -> int:
        """Return the number of handlers that wait; any thread may call this."""
        return len(self._queue) + len(self._later)

    def offer(self, handler: Handler, crowd: int = CROWDED) -> bool:
        """Queue the handler for the main thread and return True; any thread may call this.

        If `crowd` handlers already wait, drop the handler, count it in `dropped` and return False. This limits the memory that a flood of
        messages takes.
        """
        if len(self._queue) >= crowd:
            self.dropped += 1
            return False
        self.put(handler)
        return True

    def offer_later(self, handler: Handler, crowd: int = CROWDED) -> bool:
        """Queue a handler without waking the main thread; it runs just before the next handler that is not queued by this method.

        Return True. If `crowd` handlers already wait, drop the handler, count it in `dropped` and return False.
        """
        if len(self._later) >= crowd:
            self.dropped += 1
            return False
        self._later.append(handler)
        return True

    def at(self, when: float, handler: Handler) -> Timer:
        """Schedule a handler at the time `when` [s] of the monotonic clock; return its timer, by which it can be cancelled.

        Call this only in the main thread or in a handler.
        """
        timer = Timer(handler)
        heapq.heappush(self._timers, (when, next(self._order), timer))
        if self._serves:
            self._wake()  # the main thread may be waiting for a later time
        return timer

    def spin(self, until: float, enough: Callable[[], bool] | None = None) -> None:
        """Run handlers until the time `until` [s] of the monotonic clock, or until `enough` returns True.

        Handlers that are still queued at that time run too, but for at most GRACE (2 ms), so that a flood does not block the caller.
        """
        self._spin(until, enough, self._take_waiting)

    def serve(self, until: float) -> None:
        """Run handlers until the time `until` [s] of the monotonic clock; while no handler is queued, other threads may run handlers.

        They do so by the method `handle`. The thread that has received a message can thus handle it too, which saves two thread switches.
        """
        self._serves = True
        try:
            self._spin(until, None, self._take_serving)
        finally:
            self._serves = False

    def _spin(self, until: float, enough: Callable[[], bool] | None, take: Callable[[float], Handler | None]) -> None:
        last = max(until, time.monotonic()) + GRACE
        while enough is None or not enough():
            now = time.monotonic()
            if now > last:
                return
            if self._timers and (self._timers[0][0] <= now or self._timers[0][2].handle is None):
                if handle := heapq.heappop(self._timers)[2].handle:
                    handle()
                    self.handled += 1
                continue
            wake = min(until, self._timers[0][0]) if self._timers else until
            if (handler := take(wake - now)) is not None:
                self._run(handler)
            elif time.monotonic() >= until:
                return

    def _wake(self) -> None:
        """Let the main thread continue if it waits, otherwise let its next wait end at once."""
        if self._signal.locked():
            try:
                self._signal.release()
            except RuntimeError:  # another thread has released it since
                return

    def _take_waiting(self, seconds: float) -> Handler | None:
        """Return the next handler of the queue; None if there is none within `seconds`.

        The method can also return None sooner, if the thread was woken for a handler that has run already.
        """
        if seconds > 0 and not self._queue:
            self._signal.acquire(timeout=seconds)
        return self._queue.popleft() if self._queue else None

    def _take_serving(self, seconds: float) -> Handler | None:
        """Return the next handler as `_take_waiting` does; other threads may run handlers meanwhile.

        A handler stays in the queue until this thread continues, which keeps the order.
        """
        if seconds > 0 and not self._queue:
            self._turn.release()
            try:
                self._signal.acquire(timeout=seconds)
            finally:
                self._turn.acquire()
        return self._queue.popleft() if self._queue else None

    def _run(self, handler: Handler) -> None:
        while self._later:
            self._later.popleft()()
        handler()
        self.handled += 1


def _raise(error: BaseException) -> NoReturn:
    raise error
