# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from mobee.check.run import check_world
from mobee.model import World, box, cylinder, sphere
from mobee.model.world_file import load_world, shipped_worlds


@pytest.mark.parametrize("name", shipped_worlds())
def test_shipped_worlds_have_nothing_but_notes(name: str) -> None:
    assert [finding for finding in check_world(load_world(name), {}) if finding.severity != "note"] == []


def checks(world: World) -> list[str]:
    return [finding.check for finding in check_world(world, {})]


def test_a_world_in_millimetres_is_found_with_its_line() -> None:
    world = World()
    world.add("table", box(600, 600, 50), position=(400, 0, 0))
    (finding,) = check_world(world, {"table": "desk.xml:2"})
    assert (finding.check, finding.where) == ("unit", "desk.xml:2")


def test_a_grain_is_a_slip_of_unit() -> None:
    world = World()
    world.add("ball", sphere(0.00003))
    assert checks(world) == ["unit"]


def test_a_thin_obstacle_is_noted_and_a_thin_ghost_is_not() -> None:
    world = World()
    world.add("sheet", box(1, 1, 0.001))
    world.add("paper", box(1, 1, 0.001), role="ghost", position=(0, 0, 1))
    world.add("coin", cylinder(0.2, 0.002), position=(0, 0, 2))
    assert checks(world) == ["thin", "thin"]


def test_a_second_object_in_the_same_place_and_a_name_in_other_case_are_found() -> None:
    world = World()
    world.add("ball", sphere(0.05))
    world.add("Ball", sphere(0.05))
    assert checks(world) == ["duplicate", "name-case"]
