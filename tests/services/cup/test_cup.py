# SPDX-License-Identifier: Apache-2.0
"""The service that fetches the cup as a process: the test plays the controller and vision."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

import mobee
from bus_schema.messages import Event, Geometry, WorldObject
from mobee import load_robot
from mobee.errors import InvalidValue, UnknownName
from services.cup.config import Config
from tests.services.fake_controller import FakeController
from tests.services.harness import Rig, rig, wait_for

ROBOT = load_robot("icub")


@pytest.fixture
def made(tmp_path: Path) -> Iterator[Rig]:
    with rig(tmp_path, ROBOT) as bus:
        yield bus


def test_it_takes_no_part_for_a_cup_that_is_not_seen_or_no_longer(made: Rig) -> None:
    controller, events = FakeController(made, "right_arm"), made.record(Event, "cup")
    cups = made.bus.publisher(WorldObject, "cup")
    try:
        made.start("services.cup", "cup", "--world", "cup")
        wait_for(lambda: "pauses: no place of cup yet" in made.stat("cup").text, "the pause")
        shape, old = Geometry("cylinder", [0.028, 0.13]), max(0, made.bus.t - 1_500_000_000)

        def see(valid_until: int) -> None:
            cups.put(
                name="cup", geometry=shape, position=[-0.35, 0.1, -0.035], quaternion=[1.0, 0.0, 0.0, 0.0], covariance=[0.0] * 9,
                role="target", t_capture=old, valid_until=valid_until,
            )  # fmt: skip

        see(made.bus.t + 5_000_000_000)  # hidden: the newest picture that shows it is old
        wait_for(lambda: "no picture of cup for" in made.stat("cup").text, "the pause for an old picture")
        see(0)  # withdrawn
        wait_for(lambda: "cup is stale" in made.stat("cup").text, "the pause for a withdrawn cup")
        assert controller.takes == 0
        assert not controller.goals
        assert {event.code for event in events} <= {"cup_pauses", "health", "ready"}
    finally:
        controller.close()


def test_a_robot_without_fingers_is_refused() -> None:
    with pytest.raises(InvalidValue, match="has no fingers"):
        Config(marker="head").check_robot(ROBOT)


def test_it_finds_the_table_on_which_the_thing_stands(tmp_path: Path) -> None:
    assert Config(world="cup").ground() == pytest.approx(-0.1)
    higher = tmp_path / "higher.xml"
    text = (Path(mobee.__file__).parent / "robot" / "worlds" / "cup.xml").read_text(encoding="utf-8")
    higher.write_text(text.replace('<box name="table"', '<box name="floor"'), encoding="utf-8")
    assert Config(world=str(higher)).ground() == pytest.approx(-0.1)


def test_a_thing_that_stands_on_nothing_is_refused(tmp_path: Path) -> None:
    alone = tmp_path / "alone.xml"
    alone.write_text(
        '<world><sphere name="ball" radius="0.03" role="target"/><cylinder name="cup" radius="0.028" height="0.13" role="target"/></world>',
        encoding="utf-8",
    )
    with pytest.raises(InvalidValue, match="cup stands on nothing"):
        Config(world=str(alone)).check_robot(ROBOT)
    with pytest.raises(UnknownName, match="mug.*Valid: ball, cup"):
        Config(world=str(alone), target="mug").check_robot(ROBOT)
