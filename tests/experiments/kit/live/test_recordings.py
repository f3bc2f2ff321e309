# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

from experiments.kit.live.system import Touch, read_touches, touches

HAND, ELBOW = "l_hand table", "chest l_elbow"


def test_ticks_in_contact_are_one_event_until_the_pair_was_apart_long_enough() -> None:
    rows = [(5, HAND, 0.001), (6, HAND, 0.003), (10, HAND, 0.002), (16, HAND, 0.004)]
    assert touches(rows, gap=5) == [Touch(HAND, 5, 10, 0.003), Touch(HAND, 16, 16, 0.004)]


def test_pairs_are_events_of_their_own_in_order_of_time() -> None:
    rows = [(5, HAND, 0.001), (5, ELBOW, 0.002), (6, HAND, 0.001), (7, ELBOW, 0.001)]
    assert touches(rows, gap=5) == [Touch(ELBOW, 5, 7, 0.002), Touch(HAND, 5, 6, 0.001)]


def test_a_record_is_read_except_a_last_line_that_a_kill_has_cut(tmp_path: Path) -> None:
    (tmp_path / "contacts.csv").write_text(f"k,pair,depth\n3,{HAND},0.001\n9,{ELBOW},0.002\n91,l_ha")
    assert read_touches(tmp_path / "contacts.csv", dt=0.02) == [Touch(HAND, 3, 3, 0.001), Touch(ELBOW, 9, 9, 0.002)]
