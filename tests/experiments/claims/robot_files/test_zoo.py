# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.claims.robot_files.zoo import failures, read, results, run
from mobee.errors import InvalidValue
from tests.mobee_cli.test_learn import ARM

THING = '<robot name="thing"><link name="thing"/></robot>'


def options(folder: Path, actions: int = 20) -> argparse.Namespace:
    return argparse.Namespace(folders=[f"mine={folder}"], only="", minutes=0.5, actions=actions, seed=0)


@pytest.fixture
def robots(tmp_path: Path) -> Path:
    folder = tmp_path / "robots"
    folder.mkdir()
    (folder / "arm.urdf").write_text(ARM)
    (folder / "broken.urdf").write_text(ARM.replace("</robot>", ""))
    (folder / "thing.urdf").write_text(THING)
    (folder / "world.xml").write_text("<World/>")
    return folder


def test_each_robot_is_measured_once_and_its_failures_are_listed(robots: Path, tmp_path: Path) -> None:
    found = run(options(robots), tmp_path)
    (one,) = read(tmp_path)
    assert (one.robot, one.motors, one.arms, one.joints, one.at_home) == ("mine/arm.urdf", 2.0, "arm", "2", 0.0)
    assert one.transitions > 0 and one.depth_mm == 0.0
    assert found["robots"] == 1 and found["no robots"] == 1
    assert list(found["refused"]) == ["mine/broken.urdf"] and "not well-formed" in found["refused"]["mine/broken.urdf"]
    assert failures(one) == [f"tries {one.tried:.0f} of {one.can_be_tried:.0f} actions"]
    assert run(options(robots), tmp_path) == found  # nothing is measured again
    table = (tmp_path / "zoo.md").read_text()
    assert "| mine/arm.urdf | 2 | arm (2) |" in table and "| mine/broken.urdf |" in table and "thing" not in table


def test_an_arm_without_obstacles_tries_everything(robots: Path, tmp_path: Path) -> None:
    assert run(options(robots, actions=400), tmp_path)["tried all that can be tried"] == 1


def test_a_deep_contact_is_named(robots: Path, tmp_path: Path) -> None:
    run(options(robots), tmp_path)
    deep = replace(read(tmp_path)[0], depth_mm=2.5, touching="lower base", tried=1.0, can_be_tried=1.0)
    assert failures(deep) == ["comes 2.5 mm into itself (lower base)"]
    assert results(tmp_path)["within 2 mm"] == 1


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="there is no URDF or MJCF file"):
        run(options(tmp_path), tmp_path)
