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

    bus = cast("Any", type("Bus", (), {"publisher": lambda *args: None})())

    def on_alive(self, handler: object) -> None: ...


@pytest.mark.parametrize(("nice", "limit"), [(0, FROZEN_TIME), (10, FROZEN_TIME_NICE)])
def test_what_yields_to_others_may_be_silent_for_longer(nice: int, limit: float) -> None:
    supervisor = Supervisor(cast("Service", Silent()), [], lambda text: None)
    child = Child(Program("monitor", (), Path("monitor.log"), nice=nice), phase="ready", unanswered=5, answered_at=time.monotonic())
    assert not supervisor._is_frozen(child, child.answered_at + limit - 0.1)
    assert supervisor._is_frozen(child, child.answered_at + limit)
