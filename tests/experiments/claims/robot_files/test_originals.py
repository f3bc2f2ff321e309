# SPDX-License-Identifier: Apache-2.0
"""Files of 2011 to 2014 as this library reads them, beside a second reading of the program's source."""

from __future__ import annotations

import subprocess
import warnings
from pathlib import Path

import pytest

from experiments.claims.robot_files.original_comparison import compare
from experiments.claims.robot_files.original_files import find_originals
from experiments.claims.robot_files.originals import COLUMNS, RECORDS, results
from mobee.errors import InvalidValue
from mobee.robot.load import load_robot
from mobee.robot.xml.write import write_upgraded
from tests.experiments.claims.robot_files.random_original import random_original
from tests.mobee.robot.same_robot import assert_same_robot


@pytest.mark.parametrize("seed", range(5))
def test_random_files_of_that_time_are_read_as_the_program_of_2014_read_them(tmp_path: Path, seed: int) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(random_original(seed), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = load_robot(path)
    found = compare(path, robot, poses=6, seed=seed)
    assert found.agrees, found
    write_upgraded(path, tmp_path / "today.xml")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert_same_robot(robot, load_robot(tmp_path / "today.xml"))


def test_a_difference_is_found(tmp_path: Path) -> None:
    path = tmp_path / "robot.xml"
    path.write_text(random_original(3), encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        robot = load_robot(path)
    path.write_text(random_original(3).replace('<link z="0.1" ', '<link z="0.101" length="0.1" x="0.01" '), encoding="utf-8")
    assert not compare(path, robot, poses=3, seed=0).agrees


def test_a_run_without_a_record_has_no_results(tmp_path: Path) -> None:
    for _ in range(2):
        with pytest.raises(InvalidValue, match="has no record of a file: continue the run with --resume"):
            results(tmp_path)
        (tmp_path / RECORDS).write_text(",".join(COLUMNS) + "\n")


def test_every_version_of_a_history_is_found_once(tmp_path: Path) -> None:
    repository = tmp_path / "old" / "mobee"
    repository.mkdir(parents=True)
    git = ["git", "-C", str(repository), "-c", "user.name=a", "-c", "user.email=a@b"]
    subprocess.run([*git, "init", "-q"], check=True)
    for seed in (1, 2):
        (repository / "robot.xml").write_text(random_original(seed))
        (repository / "copy.xml").write_text(random_original(seed))
        (repository / "other.xml").write_text("<notes/>")
        (repository / "world.xml").write_text('<WorldList version="1.0"/>')
        subprocess.run([*git, "add", "-A"], check=True)
        subprocess.run([*git, "commit", "-q", "-m", str(seed)], check=True)
    found = find_originals([tmp_path / "old"])
    assert [one.kind for one in found] == ["robot", "robot", "world"]
    assert {one.content for one in found[:2]} == {random_original(seed).encode() for seed in (1, 2)}
    assert len({one.name for one in found}) == 3
    assert subprocess.run([*git, "cat-file", "-t", found[0].hash], capture_output=True, check=True).stdout == b"blob\n"
