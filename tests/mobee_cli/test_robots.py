# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from pathlib import Path

import pytest

from mobee.model.world_file import shipped_worlds
from mobee.robot.load import load_robot, shipped_robots
from mobee_cli.__main__ import main


def test_every_robot_and_world_is_listed_within_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robots"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert {name for name in (*shipped_robots(), *shipped_worlds()) if not any(line.startswith(f"{name} ") for line in lines)} == set()
    assert max(map(len, lines)) <= 80
    assert any("CC BY-SA 4.0" in line for line in lines)


def test_json_has_parts_counts_and_origin(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robots", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    icub, robot = printed["robots"]["icub"], load_robot("icub")
    assert icub["parts"]["left_arm"] == list(robot.parts["left_arm"].motors)
    assert icub["counts"]["solids"] + icub["counts"]["fields"] == len(robot.shapes)
    assert printed["worlds"]["table"]["objects"] == {"table": "obstacle", "ball": "target"}
    assert all(entry["about"] for kind in ("robots", "worlds") for entry in printed[kind].values())
    assert all(Path(path).is_file() for path in printed["readme"])
