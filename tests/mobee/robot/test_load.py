from __future__ import annotations

from pathlib import Path

import pytest

from mobee.errors import RobotFileError, UnknownName
from mobee.model import Model
from mobee.robot.load import ROBOTS, load_robot, load_world, shipped_robots, shipped_worlds


def test_every_shipped_robot_and_world_is_read_without_a_warning(recwarn: pytest.WarningsRecorder) -> None:
    assert shipped_robots() == ("icub", "icub_2014", "icub_katana", "katana")
    assert shipped_worlds() == ("table", "table_2014")
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


def test_the_katana_of_appendix_b_rests_without_touching_itself() -> None:
    katana = load_robot("katana")
    assert len(katana.motors) == 6
    assert len(katana.motor_table[5].joints) == 2  # the gripper's two fingers
    assert Model(katana).evaluate(katana.home).contacts == ()
