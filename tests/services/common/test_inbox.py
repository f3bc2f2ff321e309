# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import threading
import time

import pytest

from services.common.inbox import CROWDED, Inbox, Newest


def now() -> float:
    return time.monotonic()


def test_handlers_run_in_order_of_arrival_in_the_thread_that_spins() -> None:
    inbox, seen = Inbox(), []
    for i in range(100):
        inbox.put(lambda i=i: seen.append((i, threading.get_ident())))
    inbox.spin(now() + 10.0, lambda: len(seen) == 100)
    assert seen == [(i, threading.get_ident()) for i in range(100)]


def test_timers_run_by_their_time_and_equal_ones_by_their_order() -> None:
    inbox, seen, start = Inbox(), [], now()
    for name, after in (("late", 0.03), ("first", 0.01), ("second", 0.01)):
        inbox.at(start + after, lambda name=name: seen.append((name, now())))
    inbox.spin(start + 0.05)
    assert [name for name, _ in seen] == ["first", "second", "late"]
    assert all(at >= start + after for (_, at), after in zip(seen, (0.01, 0.01, 0.03), strict=True))


def test_a_timer_beyond_the_time_waits_for_the_next_spin() -> None:
    inbox, seen = Inbox(), []
    inbox.at(now() + 0.05, lambda: seen.append(1))
    inbox.spin(now() + 0.01)
    assert seen == []
    inbox.spin(now() + 0.1, lambda: bool(seen))
    assert seen == [1]


def test_a_cancelled_timer_does_nothing_and_wakes_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    inbox, seen, start = Inbox(), [], now()
    cancelled = [inbox.at(start + after, lambda: seen.append("cancelled")) for after in (0.01, 0.02)]
    inbox.at(start + 0.03, lambda: seen.append("due"))
    for timer in cancelled:
        timer.cancel()
    waits: list[float] = []
    take = inbox._take_waiting

    def counted(seconds: float) -> object:
        waits.append(seconds)
        return take(seconds)

    monkeypatch.setattr(inbox, "_take_waiting", counted)
    inbox.spin(start + 10.0, lambda: bool(seen))
    assert seen == ["due"]
    assert len(waits) == 1


def test_spin_ends_as_soon_as_it_was_enough_and_leaves_the_rest() -> None:
    inbox, seen = Inbox(), []
    for i in range(10):
        inbox.put(lambda i=i: seen.append(i))
    inbox.spin(now() + 10.0, lambda: len(seen) == 3)
    assert seen == [0, 1, 2]
    inbox.spin(now())
    assert seen == list(range(10))


def test_spin_runs_handlers_that_another_thread_puts() -> None:
    inbox, seen = Inbox(), []
    sender = threading.Timer(0.02, lambda: inbox.put(lambda: seen.append(1)))
    sender.start()
    inbox.spin(now() + 10.0, lambda: bool(seen))
    sender.join()
    assert seen == [1]


def test_a_wait_ends_however_short_it_is() -> None:
    """The queue of the standard library waits without limit if the process is interrupted as it begins to wait."""
    inbox, rescued = Inbox(), threading.Event()
    rescue = threading.Timer(20.0, lambda: (rescued.set(), inbox.put(lambda: None)))
    rescue.start()
    for take in (inbox._take_waiting, inbox._take_serving):
        for _ in range(300_000):
            inbox.put(lambda: None)
            assert take(0.0) is not None
            assert take(1e-6) is None
    rescue.cancel()
    assert not rescued.is_set()


def test_spin_returns_during_a_flood() -> None:
    """Every handler puts the next one, so the queue is never empty."""
    inbox, handled = Inbox(), 0

    def again() -> None:
        nonlocal handled
        handled += 1
        assert handled < 10_000_000
        inbox.put(again)

    again()
    for _ in range(3):
        before = handled
        inbox.spin(now() - 1.0)  # the caller is late already, and still the inbox continues
        assert handled > before


def test_an_error_of_a_handler_reaches_the_caller() -> None:
    inbox = Inbox()
    inbox.put(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        inbox.spin(now())


def test_a_crowded_inbox_drops_and_counts_optional_messages() -> None:
    inbox, seen = Inbox(), []
    taken = [inbox.offer(lambda: seen.append(1)) for _ in range(CROWDED + 5)]
    assert taken == [True] * CROWDED + [False] * 5
    assert inbox.dropped == 5
    inbox.put(lambda: seen.append(2))
    inbox.spin(now() + 5.0, lambda: 2 in seen)
    assert len(seen) == CROWDED + 1


def test_the_newest_sample_overwrites_those_that_wait_and_stands_in_the_queue_once() -> None:
    inbox, seen = Inbox(), []
    slot = Newest(inbox, seen.append)
    for i in range(5):
        slot.offer(i)
    inbox.put(lambda: seen.append("after"))
    slot.offer(5)
    inbox.spin(now())
    assert seen == [5, "after"]
    slot.offer(6)
    inbox.spin(now())
    assert seen == [5, "after", 6]


def test_no_newest_sample_is_lost_between_two_threads() -> None:
    inbox, seen = Inbox(), []
    slot = Newest(inbox, seen.append)
    sender = threading.Thread(target=lambda: [slot.offer(i) for i in range(20_000)])
    sender.start()
    inbox.spin(now() + 20.0, lambda: bool(seen) and seen[-1] == 19_999)
    sender.join()
    assert seen[-1] == 19_999
    assert seen == sorted(set(seen))


class Serving:
    """An inbox that a thread of its own serves, as the main thread of a service does; leaving raises what ended it."""

    def __init__(self) -> None:
        self.inbox = Inbox()
        self._error: BaseException | None = None
        self._started = threading.Event()
        self.thread = threading.Thread(target=self._serve)

    def __enter__(self) -> Inbox:
        self.inbox.put(self._started.set)
        self.thread.start()
        self._started.wait()
        self.idle()
        return self.inbox

    def __exit__(self, *_: object) -> None:
        self.inbox.put(lambda: _end())
        self.thread.join()
        if not isinstance(self._error, SystemExit):
            raise self._error or AssertionError("nothing ended it")

    def idle(self) -> None:
        """Wait until the thread waits: then this one may handle."""
        by: list[int] = []
        while by[-1:] != [threading.get_ident()]:
            self.inbox.handle(lambda: by.append(threading.get_ident()))
            time.sleep(0.001)

    def _serve(self) -> None:
        try:
            while True:
                self.inbox.serve(now() + 10.0)
        except BaseException as error:
            self._error = error


def _end() -> None:
    raise SystemExit


def test_while_the_inbox_is_served_the_thread_that_brings_a_message_handles_it() -> None:
    with Serving() as inbox:
        seen: list[int] = []
        for _ in range(100):
            inbox.handle(lambda: seen.append(threading.get_ident()))
        assert seen == [threading.get_ident()] * 100


def test_what_comes_while_the_server_handles_waits_for_its_turn() -> None:
    with Serving() as inbox:
        busy, resume, done, seen = threading.Event(), threading.Event(), threading.Event(), []
        inbox.put(lambda: (busy.set(), resume.wait(), seen.append("first")))
        busy.wait()
        for name in ("second", "third"):
            inbox.handle(lambda name=name: seen.append(name))
        inbox.handle(done.set)
        assert seen == []
        resume.set()
        done.wait()
        assert seen == ["first", "second", "third"]


def test_two_threads_never_handle_at_a_time_and_each_keeps_its_order() -> None:
    seen: list[tuple[int, int]] = []
    inside = 0

    def note(who: int, i: int) -> None:
        nonlocal inside
        inside += 1
        assert inside == 1
        time.sleep(0.0)  # lets another thread in, if it could come
        seen.append((who, i))
        inside -= 1

    def bring(who: int) -> None:
        for i in range(2000):
            (inbox.handle if i % 3 else inbox.put)(lambda i=i: note(who, i))

    with Serving() as inbox:
        threads = [threading.Thread(target=bring, args=(who,)) for who in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    for who in range(2):
        assert [i for by, i in seen if by == who] == list(range(2000))


def test_a_timer_set_by_another_thread_in_a_handler_is_in_time() -> None:
    with Serving() as inbox:
        rang, start = threading.Event(), now()
        inbox.handle(lambda: inbox.at(now() + 0.02, rang.set))
        assert rang.wait(5.0)
        assert 0.02 <= now() - start


def test_an_exception_in_another_thread_ends_the_server() -> None:
    seen: list[str] = []
    with pytest.raises(ZeroDivisionError), Serving() as inbox:
        inbox.handle(lambda: print(1 / 0))
        inbox.handle(lambda: seen.append("after"))
    assert seen == []


def test_without_a_server_the_thread_that_brings_a_message_queues_it() -> None:
    inbox, seen = Inbox(), []
    inbox.handle(lambda: seen.append(1))
    assert seen == []
    inbox.spin(now() + 10.0, lambda: bool(seen))
    assert seen == [1]
