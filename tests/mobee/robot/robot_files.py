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


def arm_on_a_pillar(folder: Path) -> Path:
    """Write the file of an arm of two motors; the pillar below it belongs to no part."""
    return robot_file(
        folder,
        '<link z="0.2" radius="0.05" field="0.08"><bodypart name="arm">',
        '<motor name="pan" minPos="-90" maxPos="90"><joint z="1"><link x="-0.2">',
        '<motor name="bend" minPos="0" maxPos="90"><joint y="1"><link x="-0.2" radius="0.02" field="0.06"/></joint></motor>',
        "</link></joint></motor></bodypart></link>",
    )
