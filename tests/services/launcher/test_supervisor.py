# SPDX-License-Identifier: Apache-2.0
"""Whom the supervisor counts as frozen."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, cast

import pytest

from services.common.service import Service
from services.launcher.child import Child, Program
from services.launcher.supervisor import FROZEN_TIME, FROZEN_TIME_NICE, Supervisor


class Silent:
    """Stands in for the bus: nothing is published, nobody is heard."""

    instance = "i1_launcher"

    def on_alive(self, handler: object) -> None: ...


def test_waiting_for_a_processor_or_an_inbox_that_advances_is_no_silence() -> None:
    child = Child(Program("model", (), Path("model.log")), phase="ready")
    child.note_answer(100.0)
    child.note_silence(100.5)
    assert child.starvation is not None
    child.starvation.total = 1.5
    assert child.silence(102.0) == pytest.approx(0.5)
    child.note_pulse(7, 101.0)
    assert child.silence(102.0) == pytest.approx(0.5)
    child.note_pulse(7, 102.0)
    assert child.silence(103.0) == pytest.approx(1.5)
    child.note_pulse(8, 103.0)  # a new measurement begins
    assert child.silence(103.5) == pytest.approx(0.5)
    child.note_answer(104.0)
    assert (child.silence(105.0), child.handled) == (pytest.approx(1.0), None)


@pytest.mark.parametrize(("nice", "limit"), [(0, FROZEN_TIME), (10, FROZEN_TIME_NICE)])
def test_what_yields_to_others_may_be_silent_for_longer(nice: int, limit: float) -> None:
    supervisor = Supervisor(cast("Service", Silent()), [], cast("Any", None), lambda text: None)
    child = Child(Program("monitor", (), Path("monitor.log"), nice=nice), phase="ready", unanswered=5, answered_at=time.monotonic())
    assert not supervisor._is_frozen(child, child.answered_at + limit - 0.1)
    assert supervisor._is_frozen(child, child.answered_at + limit)
