# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from services.controller import publish
from services.controller.publish import Counters


def test_the_first_step_has_no_period_and_later_ones_are_compared_with_the_due_period(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter((5.0, 5.012, 5.02))
    monkeypatch.setattr(publish.time, "monotonic", lambda: next(clock))
    counted = Counters()
    counted.note_step(0.01)
    assert counted.numbers()["jitter_ms_p99"] == -1.0
    counted.note_step(0.01)
    counted.note_step(0.01)
    assert counted.numbers()["jitter_ms_p50"] == pytest.approx(2.0)
