# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.check import check_file
from mobee_cli.__main__ import main
from tests.mobee.robot.mjcf_files import TREE, mjcf_file

pytest.importorskip("mujoco")
TOUCHING = TREE.replace('name="plate" type="box" size=".02 .03 .01"', 'name="plate" type="box" size=".3 .3 .3"')


def test_an_mjcf_is_checked_with_its_lines(tmp_path: Path) -> None:
    path = mjcf_file(tmp_path, TOUCHING)
    checked = check_file(path)
    held = [finding for finding in checked.findings if finding.check == "reader"]
    assert [(finding.severity, finding.what.split()[0]) for finding in held] == [("note", "root"), ("note", "floor")]
    always = next(finding for finding in checked.findings if finding.check in ("always-touching", "home-collision"))
    line = path.read_text().splitlines()[int(always.where.rpartition(":")[2]) - 1]
    assert "geom" in line and '<exclude body1="' in always.remedy


def test_the_lines_for_pairs_that_touch_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["check", str(mjcf_file(tmp_path, TOUCHING)), "--write-srdf"])
    printed = capsys.readouterr().out
    assert "add these lines to its <contact>:" in " ".join(printed.split())
    assert ' <exclude body1="' in printed


def test_an_mjcf_is_converted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["convert", str(mjcf_file(tmp_path, TREE)), str(tmp_path / "own.xml")]) == 0
    assert "root moves freely" in capsys.readouterr().out
    assert "<ZeroPositionKinematicTree" in (tmp_path / "own.xml").read_text()
