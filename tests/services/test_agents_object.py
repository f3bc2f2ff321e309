# SPDX-License-Identifier: Apache-2.0
"""An agent whose states hold where a cup is, as a process: the test plays the controller, the model's world and the simulator."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION, keys
from bus_schema.messages import Event, Geometry, Role, Transition
from bus_schema.rpc import Done, Empty, Goal, ObjectState, Place, World
from mobee import Grid, ObjectSpace, load_robot
from mobee.errors import MobeeError
from mobee.learning.lattice import Lattice
from services.agents.config import Config
from tests.services.fake_controller import FakeController
from tests.services.harness import Program, Refusal, Rig, rig, wait_for

ROBOT = load_robot("icub")
LEVELS = {"torso_yaw": (0.25, 0.5, 0.75)}
LINE = Grid((-0.5, -0.3), (-0.2, 0.2), (1, 2))
SPACE = ObjectSpace(Lattice(ROBOT, list(LEVELS), LEVELS, neighbours="equidistant"), LINE, "cup")
FIRST = (-0.4, -0.1, -0.05)
GIVEN: dict[str, Any] = {
    "part": "torso", "levels": LEVELS, "neighbours": "equidistant", "object": "cup", "area": ((-0.5, -0.3), (-0.2, 0.2)), "cells": (1, 2),
}  # fmt: skip
SETTINGS = """part = "torso"
levels = { torso_yaw = [0.25, 0.5, 0.75] }
neighbours = "equidistant"
object = "cup"
area = [[-0.5, -0.3], [-0.2, 0.2]]
cells = [1, 2]
put_back = [-0.4, -0.1, -0.05]
"""


class Table:
    """A cup that is pushed to the other cell, or out of its area, when the part is told to go to posture 2; and what is seen of it."""

    def __init__(self, made: Rig, controller: FakeController) -> None:
        self.rig, self.controller = made, controller
        self.place: tuple[float, float, float] | None = FIRST
        self.role: Role = "ghost"
        self.pushes, self.falls, self.hidden_at = False, False, -1
        self.old_pictures = 0  # lists after the start of each action that show the cup where it was before
        self.put_back: list[list[float]] = []
        self._before: ObjectState | None = None
        self._old = 0
        self.simulates = True
        controller.on_goal = self._push
        made.serve(keys.world_rpc("list"), Empty, self._list)
        made.serve(keys.sim("place"), Place, self._put)

    def _push(self, goal: Goal) -> None:
        self._before, self._old = self._seen(), self.old_pictures
        if self.place is not None and SPACE.postures.state_of(np.array(goal.q)) == 2:
            if self.falls:
                self.place = (self.place[0], 0.3, self.place[2])
            elif self.pushes:
                self.place = (self.place[0], -self.place[1], self.place[2])

    def _seen(self) -> ObjectState | None:
        at, posture = self.place, SPACE.postures.state_of(self.controller.q)
        if at is None or posture == self.hidden_at:
            return None
        t = self.rig.bus.t
        return ObjectState("cup", Geometry("cylinder", [0.03, 0.1]), list(at), [1.0, 0.0, 0.0, 0.0], self.role, "", t_capture=t)

    def _list(self, request: Empty, key: str) -> World:
        shown = self._seen()
        if self.controller.status == "settled" and self._old > 0 and self._before is not None:
            self._old -= 1
            shown = self._before
        return World(v=VERSION, objects=[] if shown is None else [shown])

    def _put(self, request: Place, key: str) -> Done:
        if not self.simulates:
            raise Refusal("object")
        self.put_back.append(request.position)
        self.place, self.falls = (request.position[0], request.position[1], request.position[2]), False
        return Done(v=VERSION)


class Stage:
    def __init__(self, made: Rig, folder: Path) -> None:
        self.rig = made
        self.transitions = made.record(Transition, "torso")
        self.events = made.record(Event, "agent_torso")
        self.controller = FakeController(made, "torso", period=0.005)
        self.controller.q = SPACE.postures.target(1)
        self.table = Table(made, self.controller)
        self.settings = folder / "agent.toml"
        self.settings.write_text(SETTINGS)

    def agent(self, *arguments: str) -> Program:
        return self.rig.start("services.agents", "agent_torso", "--config", str(self.settings), *arguments)

    def made(self, n: int) -> list[Transition]:
        wait_for(lambda: len(self.transitions) >= n, f"{n} transitions", 20.0)
        return list(self.transitions)

    def made_to(self, posture: int, known: int = 0) -> Transition:
        """The first transition to a posture, without the first `known` transitions."""

        def found() -> list[Transition]:
            return [one for one in self.transitions[known:] if SPACE.posture(one.goal) == posture]

        wait_for(found, f"a transition to posture {posture}", 20.0)
        return found()[0]


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    with rig(tmp_path, ROBOT) as made:
        staged = Stage(made, tmp_path)
        try:
            yield staged
        finally:
            staged.controller.close()


def test_a_state_holds_the_cell_that_pictures_from_after_the_action_show(stage: Stage) -> None:
    stage.table.pushes, stage.table.old_pictures = True, 2
    stage.agent()
    made = stage.made(12)
    assert {SPACE.cell(one.s) for one in made} == {0, 1}
    for one in made:
        pushed = SPACE.posture(one.goal) == 2
        assert SPACE.posture(one.s_next) == SPACE.posture(one.goal)
        assert (SPACE.cell(one.s_next) != SPACE.cell(one.s)) == pushed
    numbers = stage.rig.stat("agent_torso").numbers
    assert numbers["object_moves"] and numbers["retreats"] == numbers["object_absences"] == 0


def test_an_action_that_hides_the_cup_ends_aside_and_one_that_pushes_it_out_of_its_area_ends_when_it_is_back(stage: Stage) -> None:
    stage.table.pushes, stage.table.hidden_at = True, 2
    stage.agent()
    hidden = stage.made_to(2)
    assert SPACE.posture(hidden.s_next) == 0 and SPACE.cell(hidden.s_next) != SPACE.cell(hidden.s)
    assert stage.rig.stat("agent_torso").numbers["object_absences"] == 0 and not stage.table.put_back
    known, stage.table.falls = len(stage.transitions), True
    wait_for(lambda: stage.table.put_back, "the request to put it back", 20.0)
    assert stage.table.put_back[0] == list(FIRST)
    wait_for(lambda: any(event.code == "object_back" for event in stage.events), "the event", 20.0)
    fallen = stage.made_to(2, known)
    assert fallen.s_next == SPACE.state(0, LINE.cell_of(FIRST))


def test_without_a_simulator_it_waits_for_a_person_and_rests_when_it_is_asked_to(stage: Stage) -> None:
    stage.table.simulates, stage.table.place = False, None
    stage.agent()
    wait_for(lambda: "waits until its object is back" in stage.rig.stat("agent_torso").text, "the absence", 20.0)
    assert not stage.transitions
    stage.rig.call(keys.service_rpc("agent_torso", "rest"), Empty, Done)
    wait_for(lambda: stage.controller.owner == "", "the free goal")
    stage.rig.call(keys.service_rpc("agent_torso", "resume"), Empty, Done)
    stage.table.place = FIRST
    assert all(SPACE.cell(one.s) == 0 for one in stage.made(2))


def test_a_cup_that_repels_the_hand_is_refused(stage: Stage) -> None:
    stage.table.role = "target"
    program = stage.agent()
    assert program.wait(20.0) == 1
    assert 'set services.model.ghosts = ["cup"]' in program.says and "Traceback" not in program.says


def test_its_settings_make_the_space_of_the_library() -> None:
    made = Config(**GIVEN).space(ROBOT)
    assert made.settings == SPACE.settings
    assert Config(part="torso", joints=("torso_yaw",), levels=(0.2, 0.8), neighbours="equidistant").space(ROBOT).state_actions == 2


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"area": ()}, r"area = \[\]: give \[\[low, high\], \[low, high\]\] of x and y in m, for cup"),
        ({"area": ((-0.3, -0.5), (-0.2, 0.2))}, "lowest and highest value"),
        ({"cells": (1, 1)}, "two cells or more"),
        ({"aside": 3}, "3"),
        ({"put_back": (0.1, 0.2)}, "give x, y and z of the centre of cup"),
        ({"put_back": (0.0, 0.0, 0.0)}, "is outside the area"),
        ({"object": ""}, "are settings of an object"),
        ({"targets": ((-0.3, 0.0, 0.0),)}, "leave one out"),
        ({"levels": {"torso_yam": (0.2, 0.8)}}, "Did you mean 'torso_yaw'"),
        ({"levels": {"torso_yaw": (0.2, 0.8)}, "joints": ("torso_yaw", "torso_roll")}, "levels of torso_roll are missing"),
        ({"levels": dict.fromkeys(ROBOT.part("torso").motors, tuple(np.linspace(0, 1, 60)))}, "60 levels of 3 motors make 2.16e.05 states"),
    ],
)
def test_settings_that_make_no_states_are_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(MobeeError, match=says):
        Config(**{**GIVEN, **changes}).check_robot(ROBOT)
