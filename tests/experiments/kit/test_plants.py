# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco")
from experiments.kit.cup.approaches import RADIUS, TOP, Piece, Placement, ready, roadmap, robot, table, true_world  # noqa: E402  # only where MuJoCo is  # noqa: E402  # only where MuJoCo is
from experiments.kit.plants import PhysicsPlant  # noqa: E402  # only where MuJoCo is
from mobee import Model, ReachTarget, box  # noqa: E402  # only where MuJoCo is
from mobee.behaviours.bump import BumpWatch  # noqa: E402  # only where MuJoCo is
from mobee.behaviours.pick import FAST  # noqa: E402  # only where MuJoCo is
from mobee.behaviours.pre_grasp import WATCHED  # noqa: E402  # only where MuJoCo is

HIDDEN = Piece(box(0.06, 0.06, 0.09), np.array([-0.25, 0.2]), 0.09, seen=False)


def test_acting_and_reaching_end_as_on_other_plants() -> None:
    model = Model(robot(), roadmap().model.world)
    plant = PhysicsPlant(model, model.world, 0, ready(), {})
    goal = plant.measure("right_arm")
    goal[3] -= 0.2
    outcome = plant.act("right_arm", goal)
    assert outcome.settled
    np.testing.assert_allclose(outcome.q[3], goal[3], atol=0.05)
    place = model.evaluate(plant.q).position("right_palm") + (0.0, 0.0, 0.06)
    plant.present(ReachTarget(place, RADIUS))
    reached = plant.reach("right_arm", "right_palm", stay=True)
    assert reached.settled
    assert reached.missing < 0.02
    plant.present(None)


def test_a_bump_ends_a_motion_before_what_nobody_sees_is_knocked_over() -> None:
    plant = PhysicsPlant(Model(robot(), table()), true_world(Placement(np.array([-0.5, -0.1]), {"clutter": HIDDEN})), 0, ready(), {})
    trm = roadmap()
    path = trm.path(ready(), [-0.24, 0.1, TOP + 0.105, 0.0])
    ended = plant.follow_path(path, FAST, BumpWatch(robot(), WATCHED))
    assert ended.bumped
    thing = plant.things["clutter"]
    np.testing.assert_allclose(thing.position[:2], HIDDEN.place, atol=0.02)
    assert thing.rotation[2, 2] > 0.99
    free = PhysicsPlant(Model(robot(), table()), table(), 0, ready(), {})
    assert not free.follow_path(path, FAST, BumpWatch(robot(), WATCHED)).bumped
