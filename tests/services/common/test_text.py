# SPDX-License-Identifier: Apache-2.0
"""Text of others in logs and on terminals."""

from __future__ import annotations

from pathlib import Path

from services.common.entry import set_up_log
from services.common.text import printable


def test_control_characters_are_escaped_and_all_other_text_is_as_it_was() -> None:
    text = "Größe \u03b1: 3 µm, 日本"
    assert printable(text) == text
    forged = "stop\n12:00:00.000 INFO    robot_sim released\r\x1b[2J\x9b1A\u2028"
    assert printable(forged) == "stop\\x0a12:00:00.000 INFO    robot_sim released\\x0d\\x1b[2J\\x9b1A\\u2028"


def test_an_entry_of_a_log_is_one_line_and_a_traceback_keeps_its_lines(tmp_path: Path) -> None:
    log = set_up_log("robot_sim", tmp_path / "log")
    log.warning("estop: by %s", "a\nb\x1b[1m")
    log.error("failed", exc_info=ValueError("no"))
    lines = (tmp_path / "log").read_text().splitlines()
    assert lines[0].endswith("WARNING robot_sim estop: by a\\x0ab\\x1b[1m")
    assert lines[1].endswith("ERROR   robot_sim failed") and lines[-1] == "ValueError: no"
