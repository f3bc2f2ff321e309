# SPDX-License-Identifier: Apache-2.0
"""Robot files for tests, written line by line so that a message's line number can be checked."""

from __future__ import annotations

from pathlib import Path

HEAD = '<ZeroPositionKinematicTree version="2.0" robotName="toy">'
TAIL = "</ZeroPositionKinematicTree>"


def robot_file(folder: Path, *lines: str) -> Path:
    """A file whose `lines` start in line 2."""
    path = folder / "toy.xml"
    path.write_text("\n".join([HEAD, *lines, TAIL]) + "\n", encoding="utf-8")
    return path
