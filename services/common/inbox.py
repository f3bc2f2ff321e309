"""One inbox for each process: Zenoh's threads put messages in, the main thread handles them."""

from __future__ import annotations

import heapq
import itertools
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from queue import Empty, SimpleQueue
from threading import Lock
from typing import Any, NoReturn

Handler = Callable[[], None]
CROWDED = 1000  # waiting messages and calls at which further messages are dropped
CROWDED_WITH_CALLS = 2 * CROWDED  # at which further calls are dropped: a flood of messages must not make the service deaf
CROWDED_WITH_STOPS = 2 * CROWDED_WITH_CALLS  # at which even emergency stops are dropped: no flood but one of stops gets there
GRACE = 0.002  # s for which `spin` goes on with what is waiting when its time is up


class Newest:
    """A slot that holds the newest sample of a stream and stands in the inbox at most once."""

    def __init__(self, inbox: Inbox, handle: Callable[[Any], None]) -> None:
        self._inbox, self._handle, self._lock = inbox, handle, Lock()
        self._sample: Any = None

    def offer(self, sample: Any) -> None:
        """Called by Zenoh's thread."""
        with self._lock:
            waiting, self._sample = self._sample is not None, sample
        if not waiting:
            self._inbox.put(self._run)

    def _run(self) -> None:
        with self._lock:
            sample, self._sample = self._sample, None
        self._handle(sample)


class Timer:
    """What is to be done at some time, unless it is cancelled before."""

    def __init__(self, handle: Handler) -> None:
        self.handle: Handler | None = handle

    def cancel(self) -> None:
        """Have nothing done, and nobody woken for it; in a handler only."""
        self.handle = None


class Inbox:
    """What is to be done, in order of arrival, and timers."""

    def __init__(self) -> None:
        self._queue: SimpleQueue[Handler] = SimpleQueue()
        self._later: deque[Handler] = deque()
        self._timers: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()
        self._turn = Lock()  # of who runs handlers: the main thread, but while it waits in `serve`
        self._turn.acquire()
        self._serves = False
        self._calls: SimpleQueue[None] = SimpleQueue()  # for the main thread to look into the inbox while it serves
        self.dropped = 0  # what came while the inbox was crowded

    def put(self, handler: Handler) -> None:
        """Have the main thread run it; any thread may call this."""
        self._queue.put(handler)
        if self._serves:
            self._calls.put(None)

    def handle(self, handler: Handler) -> None:
        """Run it in this thread, if the main thread waits in `serve` and nothing else does here; else as put.

        What it raises is raised in the main thread.
        """
        if not self._turn.acquire(blocking=False):
            self.put(handler)
            return
        try:
            if self._queue.empty():
                self._run(handler)
            else:
                self.put(handler)
        except BaseException as error:
            self.put(partial(_raise, error))
        finally:
            self._turn.release()

    def offer(self, handler: Handler, crowd: int = CROWDED) -> bool:
        """As put, but False, and counted, while `crowd` handlers are waiting: a flood must not fill the memory."""
        if self._queue.qsize() >= crowd:
            self.dropped += 1
            return False
        self.put(handler)
        return True

    def offer_later(self, handler: Handler, crowd: int = CROWDED) -> bool:
        """As offer, but without waking the main thread: it runs before whatever is put next."""
        if len(self._later) >= crowd:
            self.dropped += 1
            return False
        self._later.append(handler)
        return True

    def at(self, when: float, handler: Handler) -> Timer:
        """Have it run at a time of the monotonic clock; main thread or in a handler only."""
        timer = Timer(handler)
        heapq.heappush(self._timers, (when, next(self._order), timer))
        if self._serves:
            self._calls.put(None)  # it may wait for a later time
        return timer

    def spin(self, until: float, enough: Callable[[], bool] | None = None) -> None:
        """Handle what comes until that time of the monotonic clock, or until it was `enough`.

        What is waiting then is handled too, as far as a short grace allows: no flood keeps the caller here.
        """
        self._spin(until, enough, self._awaited)

    def serve(self, until: float) -> None:
        """As spin, but other threads may `handle` in place of this one while it waits.

        A message is then answered by the thread that has received it, and neither it nor the answer is handed from thread to thread.
        """
        self._serves = True
        try:
            self._spin(until, None, self._called)
        finally:
            self._serves = False

    def _spin(self, until: float, enough: Callable[[], bool] | None, take: Callable[[float], Handler]) -> None:
        last = max(until, time.monotonic()) + GRACE
        while enough is None or not enough():
            now = time.monotonic()
            if now > last:
                return
            if self._timers and (self._timers[0][0] <= now or self._timers[0][2].handle is None):
                if handle := heapq.heappop(self._timers)[2].handle:
                    handle()
                continue
            wake = min(until, self._timers[0][0]) if self._timers else until
            try:
                handler = take(wake - now)
            except Empty:
                if time.monotonic() >= until:
                    return
                continue
            self._run(handler)

    def _awaited(self, seconds: float) -> Handler:
        """The next in the queue, waited for; raises Empty."""
        return self._queue.get(timeout=seconds) if seconds > 0 else self._queue.get_nowait()

    def _called(self, seconds: float) -> Handler:
        """The same while others may take their turn: nothing is taken out of the queue meanwhile, or it would lose its place."""
        if seconds > 0 and self._queue.empty():
            self._turn.release()
            try:
                self._calls.get(timeout=seconds)
            finally:
                self._turn.acquire()
        return self._queue.get_nowait()

    def _run(self, handler: Handler) -> None:
        while self._later:
            self._later.popleft()()
        handler()


def _raise(error: BaseException) -> NoReturn:
    raise error
