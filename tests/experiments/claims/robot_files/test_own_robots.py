# SPDX-License-Identifier: Apache-2.0
"""The generated robots and one of PyBullet; the tests do not install example-robot-data."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.claims.robot_files.own_robots import failures, figure, read, results, run
from experiments.claims.robot_files.sample_robots import GENERATED, robot_file
from mobee import load_robot


@pytest.mark.parametrize("name", GENERATED)
def test_generated_robots_load(name: str, tmp_path: Path) -> None:
    robot = load_robot(robot_file(name, tmp_path, tmp_path))
    assert len(robot.motors) == {"chain of 200": 200, "star of 300": 300}.get(name, 6)
    assert len(robot.solid_pairs) > 10


def arguments(**changes: object) -> argparse.Namespace:
    return argparse.Namespace(**{"robots": ["arm of 700 m", "panda_bullet"], "data": Path(), "seed": 0} | changes)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("own_robots")
    run(arguments(robots=["arm of 700 m"]), folder)
    run(arguments(), folder)
    return folder


def test_a_robot_is_measured_once_and_meets_the_claim(done: Path) -> None:
    arm, panda = read(done)
    assert (arm.robot, panda.robot) == ("arm of 700 m", "panda_bullet")
    assert (panda.touching, panda.written, panda.touching_after, panda.slides) == (2, 2, 0, 1)
    assert 0.0 < panda.slide_mm < 1.0 and panda.unsettled == 0 and arm.slide_mm == -1.0
    assert max(arm.drift_deg, panda.drift_deg, panda.field_drift_deg) < 0.5 and panda.drift_mm < 1.0
    found = results(done)
    assert (found["robots"], found["touch themselves at home"], found["and with the SRDF"]) == (2, 1, 0)


def test_failed_parts_of_the_claim_are_named(done: Path) -> None:
    good = replace(read(done)[1], actions_s=1.0, field_actions_s=1.0)
    assert failures(good) == []
    bad = replace(good, drift_mm=1.5, touching_after=1, unsettled=1, field_actions_s=16.0)
    assert failures(bad) == ["drifts", "touches itself at home", "slide off", "slow"]


def test_the_columns_of_the_table_have_different_heads(done: Path) -> None:
    cells = [line.strip("| ").split(" | ") for line in figure(done).read_text().splitlines() if not line.startswith("|---")]
    assert len(set(cells[0])) == len(cells[0]) == 14
    assert [row[0] for row in cells[1:]] == ["arm of 700 m", "panda_bullet"]


def test_a_robot_that_cannot_be_read_is_refused_and_not_tried_again(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    for _ in range(2):
        found = run(arguments(robots=["tiago"], data=tmp_path / "data"), tmp_path)
    assert "no such file" in found["refused"]["tiago"]
    assert (tmp_path / "refused.csv").read_text().count("tiago.urdf") == 1
