# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue, UnknownName
from mobee.model import World, box, cylinder
from mobee.model.model import Model
from mobee.simulation import MotorParameters, OfflinePlant, SlidingObject
from mobee.simulation.sliding import CLEARANCE, PERIOD, TOLERANCE
from tests.mobee.control.two_parts import two_part_arm
from tests.mobee.planar import RADIUS

CUP, HEIGHT, TOP = 0.04, 0.2, -0.1  # m: radius and height of the cup, top of the table; the arm moves 10 cm above it
BESIDE = (0.75, -0.2)  # m, on the right of the stretched arm's last segment


def stage(
    place: tuple[float, float] = BESIDE, ghost: str = "ghost", height: float = HEIGHT, **options: Any
) -> tuple[OfflinePlant, SlidingObject]:
    world = World()
    world.add("table", box(2.4, 2.4, 0.3), position=(0.0, 0.0, TOP - 0.15), role="ghost")
    world.add("cup", cylinder(CUP, height), position=(*place, TOP + height / 2), role=ghost, mass=0.2, friction=0.7)  # type: ignore[arg-type]
    plant = OfflinePlant(Model(two_part_arm(), world), motors=MotorParameters.ideal(), contact_forces=False)
    return plant, SlidingObject(plant, "cup", **({"friction": 0.3} | options))


def depth(plant: OfflinePlant) -> float:
    """The deepest contact of a solid of the arm with the cup, by the whole model."""
    world = World()
    for thing in plant.model.world.objects.values():
        if thing.name == "cup":
            world.add("cup", cylinder(CUP, thing.size[1]), position=thing.position)
    found = Model(plant.robot, world).evaluate(plant.motors.q).contacts
    return max((one.depth for one in found if one.kind == "solid" and one.second == "cup"), default=0.0)


@settings(max_examples=8)
@given(st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)), min_size=2, max_size=4), st.floats(-0.5, 0.5))
def test_it_never_overlaps_the_robot_moves_only_if_touched_and_stays_on_the_table(targets, y) -> None:
    plant, cup = stage((0.6, y if abs(y) > 0.15 else 0.3), area=((0.2, 1.1), (-0.8, 0.8)))
    for trunk, *arm in targets:
        plant.begin("trunk", np.array([trunk]))
        plant.begin("arm", np.array(arm))
        for _ in range(75):
            before, path, falls = cup.place, cup.path, cup.falls
            plant.tick()
            if cup.place is None:
                assert "cup" not in plant.model.world.objects
                continue
            if round(plant.time / plant.dt) % round(PERIOD / plant.dt) == 0:
                assert depth(plant) <= TOLERANCE + 1e-9
            assert np.array_equal(plant.model.world.objects["cup"].position, cup.place)
            assert cup.place[2] == TOP + HEIGHT / 2 and 0.2 <= cup.place[0] <= 1.1 and abs(cup.place[1]) <= 0.8
            if before is not None and falls == cup.falls:
                assert np.hypot(*(cup.place - before)[:2]) == pytest.approx(cup.path - path, abs=1e-12)


def test_a_sweeping_arm_pushes_it_along_and_it_rests_where_it_was_left() -> None:
    plant, cup = stage()
    plant.act("trunk", np.array([-0.4]))
    left = cup.place
    assert left is not None and cup.falls == 0
    moved = left[:2] - BESIDE
    assert moved[1] < -0.05 and cup.path == pytest.approx(np.hypot(*moved), rel=0.2)
    plant.act("trunk", np.array([0.3]))
    assert np.array_equal(cup.place, left) and cup.perceive().keys() == {"cup"}


def test_an_arm_that_does_not_touch_it_leaves_it_exactly_where_it_is() -> None:
    plant, cup = stage()
    plant.act("trunk", np.array([0.5]))
    assert cup.place is not None and cup.place[:2].tolist() == list(BESIDE) and cup.path == 0.0


@pytest.mark.parametrize(
    ("options", "place"),
    [({"friction": 0.5}, BESIDE), ({"area": ((0.0, 1.2), (-0.25, 1.0))}, BESIDE)],
    ids=["pushed above radius / friction", "out of its area"],
)
def test_it_falls_and_is_put_back_when_its_first_place_is_free(options: dict[str, Any], place: tuple[float, float]) -> None:
    plant, cup = stage(place, **options)
    plant.act("trunk", np.array([-0.3]))
    assert cup.falls == 1 and cup.place is None and cup.perceive() == {} and "cup" not in plant.model.world.objects
    plant.run(200)
    assert cup.place is None and not cup.put_back()  # the arm lies over its place
    plant.act("trunk", np.array([0.3]))
    assert cup.place is not None and cup.place[:2].tolist() == list(place)
    thing = plant.model.world.objects["cup"]
    assert (thing.role, thing.mass, thing.friction) == ("ghost", 0.2, 0.7)


def test_it_falls_where_it_is_pressed_from_above() -> None:
    plant, cup = stage(height=TOP * -1.0 - RADIUS + 0.004)  # its top is 4 mm inside the arm that passes over it
    plant.act("trunk", np.array([-0.3]))
    assert cup.falls >= 1


def test_it_is_put_back_after_the_caller_has_removed_it() -> None:
    plant, cup = stage()
    plant.act("trunk", np.array([1.0]))
    plant.model.world.remove("cup")
    plant.run(20)
    assert cup.put_back() and plant.model.world.objects["cup"].position[:2].tolist() == list(BESIDE)


def test_it_is_put_back_on_request_unless_the_robot_is_near() -> None:
    plant, cup = stage()
    plant.act("trunk", np.array([-0.4]))
    assert not cup.put_back() and cup.place is not None and cup.place[1] < BESIDE[1]
    plant.act("trunk", np.array([0.3]))
    assert cup.put_back() and cup.place[:2].tolist() == list(BESIDE) and cup.falls == 0
    near = BESIDE[1] + CUP + RADIUS + CLEARANCE
    assert near > 0.0 - 0.1  # the stretched arm at y = 0 is too near
    plant.act("trunk", np.array([0.0]))
    assert cup.put_back() == (near <= 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "mug"}, "mug"),
        ({"support": "cup"}, "no upright box"),
        ({"friction": 0.0}, "above 0"),
        ({"area": ((0.0, 0.5), (-1.0, 1.0))}, "outside of the area"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(change: dict[str, Any], message: str) -> None:
    plant, _ = stage()
    with pytest.raises((InvalidValue, UnknownName), match=message):
        SlidingObject(plant, **({"name": "cup"} | change))


def test_it_must_be_a_ghost_that_stands_on_its_support() -> None:
    with pytest.raises(InvalidValue, match="role ghost"):
        stage(ghost="obstacle")
    plant, _ = stage()
    plant.model.world.move("cup", position=(*BESIDE, 0.1))
    with pytest.raises(InvalidValue, match="above table"):
        SlidingObject(plant, "cup")


def test_after_a_restart_of_the_plant_it_is_put_back_at_once() -> None:
    plant, cup = stage(area=((0.2, 1.1), (-0.25, 0.8)))
    plant.run(300)
    plant.act("trunk", np.array([-0.3]))
    plant.act("trunk", np.array([0.3]))
    plant.act("trunk", np.array([-0.3]))
    assert cup.place is None and plant.time > 3.0
    plant.restart(0, np.array([0.3, *plant.robot.home[1:]]))
    plant.run(2 * round(PERIOD / plant.dt))
    assert cup.place is not None and cup.place[:2].tolist() == list(BESIDE)


def test_it_stays_where_the_caller_moves_it() -> None:
    plant, cup = stage()
    plant.model.world.move("cup", position=(0.75, -0.5, TOP + HEIGHT / 2))
    plant.run(10)
    assert cup.place is not None and cup.place[1] == -0.5
    plant.model.world.remove("cup")
    plant.act("trunk", np.array([-0.3]))  # there is nothing to push
    assert "cup" not in plant.model.world.objects


def test_an_object_that_the_caller_has_removed_is_not_perceived() -> None:
    plant, cup = stage()
    plant.model.world.remove("cup")
    assert cup.place is None and cup.perceive() == {}
    plant.run(10)
    assert cup.place is None and cup.falls == 0
    plant.model.world.add("cup", cylinder(CUP, HEIGHT), position=(0.75, -0.5, TOP + HEIGHT / 2), role="ghost")
    assert cup.perceive()["cup"].tolist() == [0.75, -0.5, TOP + HEIGHT / 2]


def test_an_attached_object_is_perceived_where_its_link_holds_it_and_is_not_pushed() -> None:
    plant, cup = stage()
    world, link = plant.model.world, plant.robot.links[-1]
    plant.model.attach("cup", link, plant.motors.q)
    assert cup.place == pytest.approx([*BESIDE, TOP + HEIGHT / 2])
    plant.act("trunk", np.array([-0.4]))
    held = plant.model.evaluate(plant.motors.q).objects["cup"].position
    assert cup.perceive()["cup"] == pytest.approx(held) and np.linalg.norm(held[:2] - BESIDE) > 0.1
    assert (cup.falls, cup.path) == (0, 0.0)
    plant.act("trunk", np.array([0.4]))
    with pytest.raises(InvalidValue, match="detach it first"):
        cup.put_back()
    plant.follow()
    world.detach("cup")
    here = cup.place
    plant.run(10)
    assert np.array_equal(cup.place, here)


def test_the_top_of_a_turned_support_is_turned() -> None:
    plant, _ = stage()
    half = np.sqrt(0.5)
    plant.model.world.move("table", rotation=np.array([[half, -half, 0.0], [half, half, 0.0], [0.0, 0.0, 1.0]]))
    plant.model.world.move("cup", position=(1.1, 1.1, TOP + HEIGHT / 2))  # within the bounds of the turned table, beyond its edge
    with pytest.raises(InvalidValue, match="outside of the top of table"):
        SlidingObject(plant, "cup")
    plant.model.world.move("cup", position=(1.6, 0.0, TOP + HEIGHT / 2))  # near its corner
    assert SlidingObject(plant, "cup").place is not None
