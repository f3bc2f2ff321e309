# SPDX-License-Identifier: Apache-2.0
"""An agent waits for its disk."""

from __future__ import annotations

from typing import Any

import pytest

from mobee.errors import InUse, MobeeError, NoRoom
from services.agents import store_wait
from services.agents.store_wait import PREDECESSOR, StoreWait


class Quick:
    """A service whose second passes at once."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.events, self.bus = 0.0, [], self
        monkeypatch.setattr(store_wait.time, "monotonic", lambda: self.now)

    def event(self, level: str, code: str, text: str) -> None:
        self.events.append((level, code))

    def spin(self, until: float) -> None:
        self.now = until

    def check_router(self) -> None:
        pass


class Disk:
    """A store that refuses the first appends."""

    def __init__(self, refusals: list[Exception]) -> None:
        self.refusals, self.kept = refusals, []

    def append(self, *data: Any) -> None:
        if self.refusals:
            raise self.refusals.pop(0)
        self.kept.append(data)


def test_a_write_that_the_disk_refuses_is_repeated_until_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    service, disk = Quick(monkeypatch), Disk([NoRoom("full")] * 3600)
    waits = StoreWait(service)  # type: ignore[arg-type]  # a service without a bus
    waits.let_append_wait(disk)
    disk.append(1, "a")
    disk.append(2, "b")
    assert disk.kept == [(1, "a"), (2, "b")] and service.now == 3600.0
    assert service.events == [("error", "no_room"), ("info", "continues")] and waits.status_prefix() == ""


def test_a_predecessor_is_waited_for_but_not_for_ever_and_other_errors_are_raised(monkeypatch: pytest.MonkeyPatch) -> None:
    service = Quick(monkeypatch)
    waits = StoreWait(service)  # type: ignore[arg-type]  # a service without a bus
    assert waits.until_accepted(iter_of([InUse("old"), InUse("old"), "opened"])) == "opened" and service.now == 2.0
    with pytest.raises(InUse):
        waits.until_accepted(iter_of([InUse("other")] * 100))
    assert 2.0 + PREDECESSOR < service.now <= 4.0 + PREDECESSOR
    with pytest.raises(MobeeError, match="damaged"):
        waits.until_accepted(iter_of([MobeeError("damaged")]))


def iter_of(answers: list[Any]) -> Any:
    """A function that returns or raises one answer after the other."""

    def act() -> Any:
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    return act
