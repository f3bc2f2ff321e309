# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.errors import RobotFileError, UnknownName
from mobee.robot.load import load_robot

menagerie = pytest.importorskip("mujoco_menagerie")
pytest.importorskip("mujoco")


def test_a_name_of_menagerie_is_passed_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = menagerie.get("franka_emika_panda")
    file = tmp_path / robot.name / robot.entry(robot.default_model).file
    file.parent.mkdir()
    file.write_text('<mujoco model="panda"><worldbody><body><joint name="j1"/><geom size=".1"/></body></worldbody></mujoco>')
    monkeypatch.setenv("MENAGERIE_ROOT", str(tmp_path))  # a folder with the robots: nothing is downloaded
    assert load_robot("franka_emika_panda").motors == load_robot("panda").motors == ("j1",)
    with pytest.raises(RobotFileError, match="shadow_hand: mujoco-menagerie cannot give this robot.*not found under"):
        load_robot("shadow_hand")


def test_an_unknown_name_is_answered_with_the_nearest_of_menagerie() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'shadow_hand'.*Valid: icub"):
        load_robot("shadow_hant")
