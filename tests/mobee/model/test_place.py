# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee._core import engine as core
from mobee.model.core_tables import Carried, robot_tables, volume_row
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot
from tests.mobee.model.random_scenes import loaded, posed, random_robot, random_world, solids


@pytest.mark.parametrize("robot", [loaded("icub"), loaded("icub_2014"), loaded("katana"), random_robot(np.random.default_rng(3), 6, 40)])
def test_the_core_moves_shapes_and_carried_objects_with_their_links(robot: Robot, rng: np.random.Generator) -> None:
    things = [thing for thing in random_world(rng, robot, 12).objects.values() if thing.link is not None]
    tables = robot_tables(robot, [Carried(robot.links.index(thing.link or ""), volume_row(thing)) for thing in things])
    q = posed(rng, robot)
    found = core.place(core.robot(*tables.for_core()), q, len(tables.volume))
    transforms = link_transforms(robot, q)
    volumes = [*robot.shapes, *things]
    links = [shape.link for shape in robot.shapes] + [robot.links.index(thing.link or "") for thing in things]
    expected = solids(volumes, [transforms[link] for link in links]).table[tables.name]
    assert np.array_equal(found["kind"], expected["kind"])
    assert np.array_equal(found["count"], expected["count"])
    for what in ("center", "rotation", "half", "core", "radius", "bound", "squared"):
        assert found[what] == pytest.approx(expected[what], abs=1e-13), what
    assert found["inverse"] == pytest.approx(expected["inverse"], rel=1e-13)
