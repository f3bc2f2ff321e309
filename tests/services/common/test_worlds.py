# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.errors import MobeeError
from mobee.robot.load import shipped_robots
from services.common.worlds import AT_TABLE, effective_world, is_path, world_around
from services.model.config import Config as ModelConfig
from services.robot_sim.config import Config as SimConfig

DESK = '<World name="desk"><box name="desk" width="0.6" height="0.6" depth="0.1" px="-0.4" pz="-0.15"/></World>'


@pytest.mark.parametrize(
    ("given", "robot", "world"),
    [
        ("", "icub", "table"),
        (None, "icub_katana", "table"),
        ("none", "icub", "none"),
        ("", "katana", "none"),
        ("", "arm.urdf", "none"),
        ("", "robots/icub.xml", "none"),
        ("table", "arm.urdf", "table"),
        ("desk.xml", "icub", "desk.xml"),
    ],
)
def test_the_table_stands_before_the_shipped_icubs_only(given: str | None, robot: str, world: str) -> None:
    assert effective_world(given, robot) == world


def test_the_robots_at_the_table_are_shipped() -> None:
    assert set(AT_TABLE) <= set(shipped_robots())


def test_every_service_loads_the_same_world(tmp_path: Path) -> None:
    (tmp_path / "desk.xml").write_text(DESK)
    for cls in (ModelConfig, SimConfig):
        assert list(cls().load_world().objects) == ["table", "ball"]
        assert not cls(robot="arm.urdf").load_world().objects
        assert not cls(world="none").load_world().objects
        assert list(cls(robot="arm.urdf", world=str(tmp_path / "desk.xml")).load_world().objects) == ["desk"]


def test_a_world_that_is_not_there_is_named() -> None:
    with pytest.raises(MobeeError, match="Did you mean 'table'"):
        world_around("tabel", "icub")


@pytest.mark.parametrize(("given", "is_one"), [("icub", False), ("", False), ("arm.urdf", True), ("robots/arm", True), (3, False)])
def test_a_path_differs_from_a_shipped_name(given: object, is_one: bool) -> None:
    assert is_path(given) == is_one
