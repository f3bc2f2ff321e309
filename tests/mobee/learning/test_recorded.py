from __future__ import annotations

import json

import numpy as np
import pytest

from mobee.errors import InvalidValue, MobeeError
from mobee.learning.lattice import Lattice
from mobee.learning.record import space_from
from mobee.learning.space import Space
from mobee.learning.voronoi import Voronoi
from tests.mobee.learning.toys import arm, torso, toy_robot

ROBOT = toy_robot()
TWO = ["l_shoulder_pitch", "l_elbow"]
SPACES = {
    "lattice": arm(tie_seed=3),
    "equidistant": arm(neighbours="equidistant"),
    "levels of their own": Lattice(ROBOT, TWO, [(0.1, 0.9), (0.2, 0.5, 0.8)], 3, rest=0.2),
    "drawn": Voronoi(ROBOT, TWO, 40, seed=5, neighbours=3),
    "given": Voronoi(ROBOT, TWO, np.deg2rad([[-60, 30], [-50, 40], [-30, 90]])),
    "one's own": Space(ROBOT, ["l_elbow"], [[0.5], [0.7]], [[1], [0]]),
}


@pytest.mark.parametrize("name", SPACES)
def test_a_space_comes_back_from_its_record(name):
    space = SPACES[name]
    again = space_from(json.loads(json.dumps(space.settings)), ROBOT)
    assert type(again) is type(space)
    assert again.settings == space.settings
    assert np.array_equal(again.goals, space.goals)
    assert again.samples == pytest.approx(space.samples)
    assert np.array_equal(again.target(1), space.target(1))


def test_a_record_of_before_there_were_kinds_is_a_lattice():
    assert "kind" not in torso().settings
    assert isinstance(space_from(torso().settings, ROBOT), Lattice)


def test_a_record_that_gives_another_space_now_is_refused():
    with pytest.raises(MobeeError, match="digest .*, on record 0123"):
        space_from(torso().settings | {"digest": "0123"}, ROBOT)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "none of a space"),
        ([], "no record of a space"),
        (torso().settings | {"kind": "circle"}, "kind 'circle'"),
        (torso().settings | {"robot": "katana"}, "of robot 'katana'"),
    ],
)
def test_a_record_of_something_else_is_refused(settings, message):
    with pytest.raises(InvalidValue, match=message):
        space_from(settings, ROBOT)
