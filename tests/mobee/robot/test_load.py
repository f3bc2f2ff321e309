# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee.errors import InvalidValue, RobotFileError, UnknownName
from mobee.model.model import Model
from mobee.model.world_file import load_world, shipped_worlds
from mobee.robot.load import ROBOTS, load_robot, shipped_robots
from tests.mobee.robot.urdf_files import arm_with, srdf_file


def test_every_shipped_robot_and_world_is_read_without_a_warning(recwarn: pytest.WarningsRecorder) -> None:
    assert shipped_robots() == ("icub", "icub_2014", "icub_katana", "katana")
    assert shipped_worlds() == ("cup", "push", "table", "table_2014", "things")
    assert [load_robot(name).name for name in shipped_robots()] == ["icub", "icub_2014", "icub_katana", "katana400"]
    assert all(load_world(name).objects for name in shipped_worlds())
    assert len(recwarn) == 0


def test_a_path_is_as_good_as_a_name() -> None:
    assert load_robot(ROBOTS / "icub.xml").motors == load_robot(str(ROBOTS / "icub.xml")).motors == load_robot("icub").motors


def test_a_misspelt_name_is_answered_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="unknown robot 'icbu'. Did you mean 'icub'. Valid: icub, icub_2014, icub_katana, katana"):
        load_robot("icbu")
    with pytest.raises(UnknownName, match="unknown world 'tabel'. Did you mean 'table'"):
        load_world("tabel")


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="mine.xml: no such file"):
        load_robot(tmp_path / "mine.xml")
    with pytest.raises(RobotFileError, match="mine.urdf: no such file. Give a path to a file"):
        load_robot(tmp_path / "mine.urdf")


def test_a_urdf_is_loaded_by_its_path_with_its_options(tmp_path: Path) -> None:
    path = arm_with(tmp_path, '<box size="0.1 0.1 0.1"/>')
    assert [shape.name for shape in load_robot(path).shapes] == ["palm"]
    assert [shape.name for shape in load_robot(str(path), field=0.03).shapes] == ["palm", "palm_field"]
    assert Model(load_robot(path, meshes="bounding")).evaluate(np.zeros(2)).position("hand") == pytest.approx([2, 0, 0])
    srdf = srdf_file(tmp_path, '<group name="left"><joint name="shoulder"/></group><group name="right"><joint name="elbow"/></group>')
    assert list(load_robot(path).parts) == list(load_robot(path, srdf=srdf).parts) == ["left", "right"]


@pytest.mark.parametrize("option", [{"field": 0.03}, {"meshes": "hull"}, {"srdf": "x.srdf"}])
def test_options_of_a_urdf_are_refused_for_other_files(option: dict[str, Any]) -> None:
    with pytest.raises(
        InvalidValue, match=f"{next(iter(option))}= is for URDF and MJCF files only, and .*katana.xml is none.*Leave it out"
    ):
        load_robot("katana", **option)


def test_unknown_values_of_options_are_refused(tmp_path: Path) -> None:
    path = arm_with(tmp_path, '<box size="0.1 0.1 0.1"/>')
    with pytest.raises(InvalidValue, match='meshes=.exact. is unknown. Valid: "hull", "bounding"'):
        load_robot(path, meshes="exact")
    with pytest.raises(RobotFileError, match="nowhere.srdf: cannot be read"):
        load_robot(path, srdf=tmp_path / "nowhere.srdf")


def test_xacro_is_refused_with_the_command_that_makes_a_urdf_of_it(tmp_path: Path) -> None:
    with pytest.raises(
        RobotFileError, match="mine.urdf.xacro: a xacro file must be converted to URDF first. Run: xacro mine.urdf.xacro > mine.urdf"
    ):
        load_robot(tmp_path / "mine.urdf.xacro")


def test_the_katana_of_appendix_b_rests_without_touching_itself() -> None:
    katana = load_robot("katana")
    assert len(katana.motors) == 6
    assert len(katana.motor_table[5].joints) == 2  # the gripper's two fingers
    assert Model(katana).evaluate(katana.home).contacts == ()


def test_a_value_that_is_neither_name_nor_path_is_refused() -> None:
    with pytest.raises(InvalidValue, match="robot is 3; it must be a path, or a name: icub,"):
        load_robot(3)
    with pytest.raises(InvalidValue, match="world is None; .* table,"):
        load_world(None)
