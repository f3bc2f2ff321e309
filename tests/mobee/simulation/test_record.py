# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from mobee import Gains, Model, MotorParameters, OfflinePlant, World, box
from mobee.robot.robot import Robot
from tests.mobee.control.two_parts import two_part_arm


def settings(robot: Robot | None = None, world: World | None = None, **options: Any) -> dict[str, Any]:
    return OfflinePlant(Model(two_part_arm() if robot is None else robot, world), **options).settings


def cube(x: float = 1.0) -> World:
    world = World()
    world.add("cube", box(0.1, 0.1, 0.1), position=(x, 0.0, 0.0), color=(1.0, 0.0, 0.0, 1.0))
    return world


def test_equal_plants_have_equal_records_for_any_seed_and_survive_json() -> None:
    one = settings(world=cube(), seed=0)
    assert one == settings(world=cube(), seed=1) == json.loads(json.dumps(one))
    assert one["gains"]["settle"]["timeout"] == 20.0 and one["world"]["cube"]["position"] == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("option", "key"),
    [
        ({"gains": Gains.published_2014()}, "gains"),
        ({"motors": MotorParameters.ideal()}, "motors"),
        ({"dt": 0.02}, "dt"),
        ({"propagate": "part"}, "propagate"),
        ({"modality": "position"}, "modality"),
        ({"speed_scale": 0.5}, "speed_scale"),
        ({"contact_forces": False}, "contact_forces"),
        ({"command_age": 2}, "command_age"),
        ({"active": ["arm"]}, "active"),
        ({"world": cube()}, "world"),
    ],
    ids=lambda value: value if isinstance(value, str) else next(iter(value)),  # the same in every process: no addresses
)
def test_every_option_changes_its_own_setting(option: dict[str, Any], key: str) -> None:
    one, other = settings(), settings(**option)
    assert {name for name in one if one[name] != other[name]} == {key}


def test_another_home_limit_or_place_of_an_object_is_another_plant() -> None:
    robot = two_part_arm()
    first, *others = robot.motor_table
    moved = settings(replace(robot, motor_table=(replace(first, home=first.home + 0.1), *others)))
    assert moved["robot"] == settings()["robot"] and moved["digest"] != settings()["digest"]
    limited = replace(robot, motor_table=(replace(first, limits=first.limits * 0.9), *others))
    assert settings(limited)["digest"] != settings()["digest"]
    assert settings(world=cube())["world"] != settings(world=cube(1.1))["world"]


def test_where_a_robot_was_read_from_makes_no_difference() -> None:
    robot = two_part_arm()
    assert settings(replace(robot, where={("joint", "a"): "elsewhere.xml:3"})) == settings(robot)
