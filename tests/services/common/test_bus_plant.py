# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from bus_schema import VERSION, keys
from bus_schema.messages import Geometry
from bus_schema.rpc import AddObject, Done, Empty, ObjectState, OneName, World
from mobee import load_robot
from mobee.errors import ActionInterrupted, InvalidValue, MobeeError, UnknownName
from mobee.reach import ReachTarget
from services.common.bus_plant import BusPlant
from services.common.config import ServiceConfig
from services.common.service import Service
from tests.services.fake_controller import FakeController
from tests.services.harness import rig

ROBOT = load_robot("icub")
CHANGES: list[str] = []  # calls that change the world


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[BusPlant]:
    with rig(tmp_path_factory.mktemp("plant"), ROBOT) as made, Service("test", ServiceConfig(endpoint=made.endpoint), ROBOT) as service:
        controller = FakeController(made, "torso")
        ball = ObjectState("ball", Geometry("sphere", [0.03]), [-0.3, 0.1, 0.1], [1.0, 0.0, 0.0, 0.0], role="target", link="l_hand")
        made.serve(keys.world_rpc("list"), Empty, lambda *_: World(v=VERSION, objects=[ball]))
        for call, request in (("add", AddObject), ("remove", OneName)):
            made.serve(keys.world_rpc(call), request, lambda *_, call=call: CHANGES.append(call) or Done(v=VERSION))
        yield BusPlant(service, ROBOT, ("torso",))
        controller.close()


@pytest.mark.parametrize(
    ("part", "target", "error", "says"),
    [
        ("head", np.zeros(6), UnknownName, "unknown part of this plant 'head'. Valid: torso."),
        ("tail", np.zeros(6), UnknownName, "unknown part 'tail'"),
        ("torso", np.array([0.0, np.nan, 0.0]), InvalidValue, "number 1 is nan; must be 3 finite numbers"),
        ("torso", np.zeros(2), InvalidValue, "must be 3 finite numbers"),
    ],
)
def test_a_part_or_target_that_cannot_be_is_refused_at_once(
    plant: BusPlant, part: str, target: np.ndarray, error: type[MobeeError], says: str
) -> None:
    with pytest.raises(error, match=says):
        plant.act(part, target)


def test_a_part_of_the_robot_that_is_not_one_of_the_plant_is_not_measured(plant: BusPlant) -> None:
    with pytest.raises(UnknownName, match="part of this plant"):
        plant.measure("head")
    assert len(plant.measure("torso")) == 3


def test_an_object_that_the_part_carries_with_the_marker_is_not_reached_for(plant: BusPlant) -> None:
    plant.present_object("ball")
    with pytest.raises(InvalidValue, match="'ball' is attached to the link 'l_hand', which torso moves"):
        plant.reach("torso", "right_palm")


def test_a_plant_that_rests_does_not_present_its_target_again(plant: BusPlant) -> None:
    CHANGES.clear()
    plant.present(ReachTarget(np.array([-0.3, 0.0, 0.1])))
    plant.rest()
    with pytest.raises(ActionInterrupted, match="this service rests"):
        plant.reach("torso", "right_palm")
    assert CHANGES == ["add", "remove"]
