# SPDX-License-Identifier: Apache-2.0
"""The barrier's bookkeeping, on a bus that the test plays."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from bus_schema import VERSION
from bus_schema.messages import StepDone, Turn
from services.common.lockstep import Barrier


class FakeService:
    """What a Barrier asks of a service; a turn that is given lands in `turns`."""

    def __init__(self) -> None:
        self.alive: dict[str, set[str]] = {}
        self.turns: list[tuple[str, int]] = []
        self.waits: Callable[[], None] = lambda: None  # what happens while it waits
        self.bus = SimpleNamespace(k=0, dt=20_000_000, publisher=self._publisher)

    def _publisher(self, cls: Any, name: str) -> Any:
        return SimpleNamespace(put=lambda **fields: self.turns.append((cls.stream.key(name), self.bus.k)))

    def on_each(self, cls: Any, handler: Callable[[StepDone], None]) -> None:
        assert cls is StepDone
        self.note = handler

    def on_alive(self, handler: Callable[[str, str, bool], None]) -> None:
        self.note_alive = handler

    def spin(self, until: float, enough: Callable[[], bool]) -> None:
        self.waits()


class Bench:
    def __init__(self) -> None:
        self.service, self.removed = FakeService(), []
        self.barrier = Barrier(self.service, ("model", "controller", "agent"), lambda who, why: self.removed.append((who, why)))

    def done(self, who: str, k: int, **fields: Any) -> None:
        header = {"v": VERSION, "run": "r", "src": who, "seq": 0, "k": k, "t": 0, "tw": 0}
        self.service.note(StepDone(**header, re_k=k, **fields))

    def begun(self) -> Bench:
        for who in ("model", "controller", "agent"):
            self.done(who, 0)
        self.service.bus.k = 1
        return self


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_it_begins_when_everybody_has_come(bench: Bench) -> None:
    assert bench.barrier.absent() == ["agent", "controller", "model"]
    bench.done("model", 0)
    bench.done("controller", 0)
    assert bench.barrier.absent() == ["agent"]
    bench.done("agent", 0)
    assert bench.barrier.absent() == []
    assert bench.removed == []


def test_a_participant_that_is_not_busy_gets_its_turn_and_must_answer(bench: Bench) -> None:
    bench.begun().service.turns.clear()
    bench.done("model", 1)
    bench.done("controller", 1)
    assert bench.barrier.missing(1) == ["agent"]
    assert bench.service.turns == [(Turn.stream.key("agent"), 1)]
    bench.done("agent", 1)
    assert bench.barrier.missing(1) == []


def test_an_answer_counts_for_those_whose_answers_it_includes(bench: Bench) -> None:
    bench.begun().done("controller", 1, busy=["agent"], including=["model"])
    assert bench.barrier.missing(1) == []
    bench.done("controller", 2, busy=["agent"], including=["model", "newcomer"])
    assert bench.barrier.missing(3) == ["agent", "controller", "model", "newcomer"]


def test_a_busy_participant_need_not_answer(bench: Bench) -> None:
    bench.begun().service.turns.clear()
    bench.done("model", 1)
    assert bench.barrier.missing(1) == ["agent", "controller"]
    bench.done("controller", 1, busy=["agent"])
    assert bench.barrier.missing(1) == []
    assert bench.service.turns == []


def test_an_answer_to_an_older_tick_does_not_count(bench: Bench) -> None:
    bench.begun()
    bench.done("controller", 0, busy=["agent"])
    assert bench.barrier.missing(1) == ["agent", "controller", "model"]


def test_a_late_participant_is_dropped_reported_and_returns_with_its_next_answer(bench: Bench) -> None:
    bench.begun().service.waits = lambda: bench.done("model", 1)
    assert bench.barrier.wait(1) == ["agent", "controller"]
    assert [who for who, _ in bench.removed] == ["agent", "controller"]
    assert "within 2 s" in bench.removed[0][1]
    bench.service.bus.k = 2
    bench.service.waits = lambda: bench.done("model", 2)
    assert bench.barrier.wait(2) == []
    assert bench.barrier.absent() == ["agent", "controller"]
    bench.done("agent", 2)
    assert bench.barrier.missing(3) == ["agent", "model"]


def test_a_process_that_ends_releases_the_barrier_and_is_reported(bench: Bench) -> None:
    bench.begun()
    bench.done("model", 1)
    bench.done("agent", 1)
    bench.service.note_alive("controller", "i1", False)
    assert bench.barrier.missing(1) == []
    assert bench.removed == [("controller", "is gone")]


def test_one_of_two_instances_that_goes_is_no_loss(bench: Bench) -> None:
    bench.begun().service.alive["agent"] = {"i2"}
    bench.service.note_alive("agent", "i1", False)
    assert bench.removed == []


def test_without_a_controller_all_are_asked(bench: Bench) -> None:
    bench.begun().service.note_alive("controller", "i1", False)
    bench.service.bus.k = 2
    bench.service.turns.clear()
    bench.barrier.wait(2)
    assert (Turn.stream.key("agent"), 2) in bench.service.turns


def test_a_participant_may_leave_with_its_last_answer(bench: Bench) -> None:
    bench.begun()
    bench.done("agent", 1, last=True)
    bench.done("model", 1)
    bench.done("controller", 1)
    assert bench.barrier.missing(1) == []
    bench.service.note_alive("agent", "i1", False)
    assert bench.removed == []
    assert bench.barrier.absent() == []


def test_an_answer_without_an_input_is_reported(bench: Bench) -> None:
    bench.begun().done("controller", 1, ok=False)
    assert bench.removed == [("controller", "lacked an input at tick 1")]


def test_a_process_that_answers_becomes_a_participant(bench: Bench) -> None:
    bench.begun().done("stranger", 1)
    assert "stranger" in bench.barrier.missing(2)


def test_a_new_run_waits_for_all_participants_again(bench: Bench) -> None:
    bench.begun().barrier.begin()
    assert bench.barrier.absent() == ["agent", "controller", "model"]
    assert bench.barrier.missing(1) == []
