# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch5_control import forced_contact

DT = 0.01


def test_a_hand_that_stops_before_it_arrives_is_dead_and_one_that_arrives_is_not() -> None:
    path = np.linspace(0.0, 0.2, 100)
    stopping = np.concatenate([path, np.full(80, 0.2), 0.2 + path, np.full(100, 0.4)])
    straight = np.concatenate([path, 0.2 + path, np.full(100, 0.4)])
    hands = [np.stack([path, 0.0 * path, 0.0 * path], axis=1) for path in (stopping, straight)]
    assert forced_contact.dead_time(hands[0], DT) == pytest.approx(0.8, abs=0.05)
    assert forced_contact.dead_time(hands[1], DT) == 0.0


def test_more_force_drives_a_field_deeper_into_the_table(monkeypatch) -> None:
    monkeypatch.setattr(forced_contact, "LEVEL_SECONDS", 2.0)
    still, pushed = forced_contact.press("default", "table-left-hand", (0.0, 300.0), 0)
    assert still["field_mm"] == 0.0 and pushed["field_mm"] > 5.0
    assert still["clause_deg"] < 0.0 and still["limit_deg"] < 0.0
