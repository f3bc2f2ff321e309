from __future__ import annotations

import numpy as np
import pytest

from mobee.engine.engine import Engine
from mobee.engine.layout import INVERSE, SLOT
from mobee.engine.pack import _rows
from mobee.kinematics import link_transforms
from mobee.robot.robot import Robot
from tests.mobee.engine.random_scenes import loaded, placed, posed, random_robot, random_world


@pytest.mark.parametrize("robot", [loaded("icub"), loaded("icub_2014"), loaded("katana"), random_robot(np.random.default_rng(3), 6, 40)])
@pytest.mark.parametrize("poses", [1, 4])
def test_slots_are_the_volumes_placed_one_by_one(robot: Robot, poses: int, rng: np.random.Generator) -> None:
    """Of every volume but the sphere, whose rotation nobody reads, all of the slot; of a batch, what its last pose leaves."""
    engine, snapshot, q = Engine(robot), random_world(rng, robot, 12).snapshot, posed(rng, robot, poses)
    engine.contacts(q, snapshot, -1)
    here, slots = engine._rooms[-1].scene, engine._rooms[-1].slots
    assert here is not None
    transforms = link_transforms(robot, q[-1])
    rows, _ = _rows(robot.shapes)
    for slot, index in enumerate(here.packed.order):
        if index >= len(robot.shapes):
            name = snapshot.names[here.carried[index - len(robot.shapes)]]
            row, link = snapshot.rows[snapshot.names.index(name)], robot.links.index(snapshot.objects[name].link or "")
        else:
            row, link = rows[index], robot.shapes[index].link
        expected = placed(row, transforms[link])[: INVERSE + 1]
        found = slots[slot * SLOT : slot * SLOT + len(expected)].copy()
        if row[0] == 0:
            found[3:12] = expected[3:12]
        assert found == pytest.approx(expected, abs=1e-13), index
