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
    inbox.spin(now())
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


def test_a_timer_that_was_cancelled_does_nothing_and_wakes_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    inbox, seen, start = Inbox(), [], now()
    cancelled = [inbox.at(start + after, lambda: seen.append("cancelled")) for after in (0.01, 0.02)]
    inbox.at(start + 0.03, lambda: seen.append("due"))
    for timer in cancelled:
        timer.cancel()
    waits: list[float] = []
    take = inbox._queue.get

    class Queue:
        def get(self, timeout: float) -> object:
            waits.append(timeout)
            return take(timeout=timeout)

        get_nowait = inbox._queue.get_nowait

    monkeypatch.setattr(inbox, "_queue", Queue())
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


def test_spin_wakes_up_for_what_another_thread_puts() -> None:
    inbox, seen = Inbox(), []
    sender = threading.Timer(0.02, lambda: inbox.put(lambda: seen.append(1)))
    sender.start()
    inbox.spin(now() + 10.0, lambda: bool(seen))
    sender.join()
    assert seen == [1]


def test_spin_returns_although_the_flood_goes_on() -> None:
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
        inbox.spin(now() - 1.0)  # the caller is late already, and still the inbox goes on
        assert handled > before


def test_an_error_of_a_handler_reaches_the_caller() -> None:
    inbox = Inbox()
    inbox.put(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        inbox.spin(now())


def test_a_crowded_inbox_drops_and_counts_what_may_be_dropped() -> None:
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
