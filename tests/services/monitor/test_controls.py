# SPDX-License-Identifier: Apache-2.0
"""The commands of the page on the bus."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from bus_schema.messages import EStop
from services.common.observe import listen
from services.common.service import Service
from services.monitor.controls import STOP_PERIOD, Known, PageControls
from services.monitor.web.board import Board
from services.monitor.web.server import Refused
from tests.services.harness import wait_for
from tests.services.stage import Stage


class Stopped:
    """Controls on a bus, and the stops that they have sent."""

    def __init__(self, stage: Stage) -> None:
        self.known, self.sent = Known(), 0
        self.on_stop: Callable[[], None] = lambda: None
        service: Any = SimpleNamespace(bus=stage.bus, config=SimpleNamespace(endpoint=stage.endpoint), call=lambda *what, **fields: None)
        self.controls = PageControls(cast(Service, service), stage.robot, self.known, Board(), lambda shown: None)
        listen(stage.session, EStop.stream.key(), lambda heard: self._note())

    def _note(self) -> None:
        self.sent += 1
        self.on_stop()

    def confirm(self) -> None:
        """All parts report the stop."""
        self.known.stopped = time.monotonic()


@pytest.fixture
def stopped(free_port: int) -> Iterator[Stopped]:
    stage = Stage(free_port)
    yield Stopped(stage)
    stage.close()


def test_a_stop_is_repeated_until_all_parts_have_reported_it_and_never_after_that(stopped: Stopped) -> None:
    """The parts report it for a moment only, because somebody releases the robot at once."""
    threading.Timer(2.5 * STOP_PERIOD, stopped.confirm).start()
    assert stopped.controls.do("p", "stop", {}) == "Stopped: all motors."
    repeated = stopped.sent
    assert repeated >= 2
    stopped.on_stop = stopped.confirm
    assert stopped.controls.do("p", "stop", {}) == "Stopped: all motors."
    time.sleep(2.0 * STOP_PERIOD)
    assert stopped.sent == repeated + 1


def test_a_stop_is_sent_although_all_parts_seem_to_report_it_already(stopped: Stopped) -> None:
    """Their newest states can be older than a release a moment ago."""
    stopped.known.stopped = float("inf")
    assert stopped.controls.do("p", "stop", {}) == "Stopped: all motors."
    wait_for(lambda: stopped.sent == 1, "the stop")


def test_a_release_ends_the_repetition_of_a_stop_that_was_not_confirmed(stopped: Stopped) -> None:
    stopped.on_stop = threading.Thread(target=stopped.controls.do, args=("other", "release", {})).start
    with pytest.raises(Refused, match="released the robot before all parts confirmed"):
        stopped.controls.do("p", "stop", {})
    assert stopped.sent == 1


def test_a_stop_that_is_not_confirmed_is_said(stopped: Stopped) -> None:
    stopped.confirm()  # an earlier one
    with pytest.raises(Refused, match="use the robot's own emergency button"):
        stopped.controls.do("p", "stop", {})
