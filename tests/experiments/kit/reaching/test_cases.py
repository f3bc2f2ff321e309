# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from experiments.kit.reaching.arm import MARKER, arm_belief, reach_plant
from experiments.kit.reaching.cases import OBSTACLE, SCENES, SPEED, Case, make_cases
from mobee.reach import ReachTarget

HERE = np.array([-0.3, 0.2, 0.2])


@pytest.mark.parametrize("scene", SCENES)
def test_cases_begin_where_nothing_touches_and_the_same_seed_draws_the_same(scene):
    cases, again = make_cases(scene, 3, 0), make_cases(scene, 3, 0)
    for case, other in zip(cases, again, strict=True):
        belief = arm_belief(case.world())
        belief.present(case.target)
        assert belief.sound(case.start[None])[0] and np.array_equal(case.start, other.start)
        assert (case.obstacle is not None) == (scene == "between") == (OBSTACLE in case.world().objects)
        assert (case.to is not None) == (scene == "moving")


def test_the_hand_against_the_object_is_near_it_and_turned_away():
    belief = arm_belief()
    for case in make_cases("against", 3, 0):
        pose = belief.model.evaluate(belief.whole(case.start))
        assert pose.normal(MARKER) @ (case.target.position - pose.position(MARKER)) < 0.0


def test_a_target_moves_at_its_speed_and_stops_or_goes_to_and_fro():
    case = Case(ReachTarget(HERE), np.zeros(4), to=HERE + (0.0, 0.0, 2.0 * SPEED))
    assert np.allclose(case.target_at(1.0), HERE + (0.0, 0.0, SPEED))
    assert np.allclose(case.target_at(3.0), case.to)
    back = replace(case, to_and_fro=True)
    assert np.allclose(back.target_at(3.0), HERE + (0.0, 0.0, SPEED)) and np.allclose(back.seen_at(4.0).position, HERE)


def test_the_law_of_a_plant_is_the_one_asked_for():
    assert reach_plant(0).settings["gains"] != reach_plant(0, "default").settings["gains"]
