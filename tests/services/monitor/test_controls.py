# SPDX-License-Identifier: Apache-2.0
"""The commands of the page on the bus."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

from bus_schema import keys
from bus_schema.messages import EStop, Geometry, Motion
from bus_schema.rpc import ObjectState
from mobee import load_robot
from mobee.reach import TARGET
from services.common.observe import listen
from services.common.rpc import CallFailed
from services.common.service import Service
from services.monitor.controls import STOP_PERIOD, Known, PageControls
from services.monitor.web.board import Board
from services.monitor.web.server import Refused
from tests.services.harness import wait_for
from tests.services.stage import Stage

PLACE = [-0.3, 0.2, 0.1]  # m


class Stopped:
    """Controls on a bus, and the stops that they have sent."""

    def __init__(self, stage: Stage) -> None:
        self.known, self.sent = Known(), 0
        self.on_stop: Callable[[], None] = lambda: None
        service: Any = SimpleNamespace(bus=stage.bus, config=SimpleNamespace(endpoint=stage.endpoint), call=lambda *what, **fields: None)
        self.controls = PageControls(cast(Service, service), stage.robot, self.known, Board(), lambda shown: None)
        listen(stage.session, EStop.stream.key(), lambda heard: self._note())

    def _note(self) -> None:
        self.sent += 1
        self.on_stop()

    def confirm(self) -> None:
        """All parts report the stop."""
        self.known.stopped = time.monotonic()


class Clicked:
    """Controls of a page whose calls are answered at once, and the calls that they have made, with their data.

    The world of the model and the presenter of its target are simulated. `presents`: name of the service that presents the target.
    `reached`: data of the newest reach. `refuses`: the controller refuses reaches.
    """

    def __init__(self) -> None:
        self.made: list[str] = []
        self.reached: dict[str, Any] = {}
        self.refuses = False
        self.presents, self.epoch = "", 1
        self.known = Known()
        self.alive: dict[str, set[str]] = {}
        bus = SimpleNamespace(publisher=lambda cls: None)
        service: Any = SimpleNamespace(bus=bus, call=self._call, alive=self.alive, instance="i")
        self.robot = load_robot("icub")
        self.controls = PageControls(cast(Service, service), self.robot, self.known, Board(), lambda shown: None)

    def do(self, verb: str, **given: Any) -> str:
        return self.controls.do("p", verb, given)

    def move_slider(self, part: str) -> None:
        self.do("goal", part=part, q=self.robot.home[self.robot.part(part).slice].tolist())

    def restart_controller(self, part: str) -> None:
        """The part has no owner then."""
        self.known.motions[part] = cast(Motion, SimpleNamespace(epoch=0, status="idle"))

    def _call(self, key: str, request: object, reply: object, **fields: Any) -> Any:
        self.made.append(key)
        part = key.split("/")[0]
        if key == keys.goal(part, "take"):
            self.epoch += 1
            self.known.motions[part] = cast(Motion, SimpleNamespace(epoch=self.epoch, status="idle"))
            return SimpleNamespace(epoch=self.epoch)
        if self.presents and key == keys.service_rpc(self.presents, "rest"):
            self.presents = ""
        if key == keys.world_rpc("add"):
            if self.presents not in ("", "monitor"):
                raise CallFailed("owned", f"{self.presents} presents 'reach_target', and only one service at a time can")
            self.presents = "monitor"
        if key == keys.world_rpc("remove"):
            self.presents = ""
        if key == keys.goal(part, "reach"):
            if self.refuses:
                raise CallFailed("reach", "the part cannot reach for it")
            self.reached = fields
        return None


@pytest.fixture
def clicked() -> Clicked:
    return Clicked()


def test_the_target_of_a_page_is_removed_when_the_part_is_given_back_although_a_slider_was_moved(clicked: Clicked) -> None:
    clicked.do("reach", part="right_arm", position=PLACE)
    clicked.move_slider("right_arm")
    assert clicked.presents == "monitor"
    clicked.do("give", part="right_arm")
    assert clicked.presents == ""


@pytest.mark.parametrize("moves_slider", [False, True])
def test_a_part_that_the_controller_has_lost_goes_back_to_its_agent(clicked: Clicked, moves_slider: bool) -> None:
    clicked.alive["agent_right_arm"] = {"a"}
    clicked.do("reach", part="right_arm", position=PLACE)
    if moves_slider:
        clicked.move_slider("right_arm")
    clicked.controls.tend({"p"})
    assert clicked.made[-1] == keys.goal("right_arm", "goal" if moves_slider else "reach")
    clicked.restart_controller("right_arm")
    clicked.controls.tend({"p"})
    assert (clicked.presents, clicked.made[-1]) == ("", keys.service_rpc("agent_right_arm", "resume"))


def test_a_part_that_was_taken_for_a_refused_reach_goes_back_to_its_agent(clicked: Clicked) -> None:
    clicked.alive["agent_right_arm"], clicked.refuses = {"a"}, True
    with pytest.raises(Refused, match="cannot reach for it"):
        clicked.do("reach", part="right_arm", position=PLACE)
    assert (clicked.presents, clicked.made[-1]) == ("", keys.service_rpc("agent_right_arm", "resume"))


def test_a_part_that_a_page_had_before_a_refused_reach_stays_with_the_page(clicked: Clicked) -> None:
    clicked.alive["agent_right_arm"], clicked.refuses = {"a"}, True
    clicked.move_slider("right_arm")
    with pytest.raises(Refused, match="cannot reach for it"):
        clicked.do("reach", part="right_arm", position=PLACE)
    assert keys.service_rpc("agent_right_arm", "resume") not in clicked.made


def test_a_page_presents_a_target_instead_of_an_agent_that_rests_for_it(clicked: Clicked) -> None:
    clicked.alive["agent_right_arm"], clicked.presents = {"a"}, "agent_right_arm"
    clicked.do("reach", part="right_arm", position=PLACE)
    assert clicked.presents == "monitor"
    assert clicked.made.count(keys.world_rpc("add")) == 1  # no other service may remove the target of an agent
    clicked.do("give", part="right_arm")
    assert (clicked.presents, clicked.made[-1]) == ("", keys.service_rpc("agent_right_arm", "resume"))


def test_a_page_leaves_the_target_of_a_working_agent(clicked: Clicked) -> None:
    clicked.alive |= {"agent_right_arm": {"a"}, "agent_left_arm": {"b"}}
    clicked.presents = "agent_right_arm"
    clicked.known.objects[TARGET] = ObjectState(TARGET, Geometry("sphere", [0.05]), PLACE, [1.0, 0.0, 0.0, 0.0], role="target", link="")
    with pytest.raises(Refused, match="agent_right_arm presents"):
        clicked.do("reach", part="left_arm", position=PLACE)
    clicked.do("give", part="left_arm")
    assert clicked.presents == "agent_right_arm"
    assert keys.world_rpc("remove") not in clicked.made


def test_a_page_reaches_for_the_sphere_within_an_object_without_the_margin_of_its_shape(clicked: Clicked) -> None:
    cup = ObjectState("cup", Geometry("cylinder", [0.06, 0.04]), PLACE, [1.0, 0.0, 0.0, 0.0], role="target", link="", margin=0.008)
    clicked.known.objects["cup"] = cup
    clicked.do("reach", object="cup")
    assert clicked.reached["radius"] == pytest.approx(0.012)


def test_a_hand_does_not_reach_for_an_object_that_it_holds(clicked: Clicked) -> None:
    sphere = Geometry("sphere", [0.03])
    clicked.known.objects["ball"] = ObjectState("ball", sphere, PLACE, [1.0, 0.0, 0.0, 0.0], role="target", link="r_hand")
    with pytest.raises(Refused, match="'ball' is attached to the link 'r_hand', which right_arm moves"):
        clicked.do("reach", object="ball", part="right_arm")
    assert not clicked.made
    clicked.do("reach", object="ball", part="left_arm")
    assert clicked.reached["marker"] == "left_palm"


def test_the_explorer_changes_for_the_agents_that_run(clicked: Clicked) -> None:
    clicked.alive |= {"agent_left_arm": {"a"}, "agent_torso": set()}  # the second has ended
    assert "left arm explore" in clicked.do("explore", explorer="random")
    assert clicked.made == [keys.service_rpc("agent_left_arm", "explore")]
    clicked.alive["agent_left_arm"].clear()
    with pytest.raises(Refused, match="no agent runs"):
        clicked.do("explore", explorer="random")


@pytest.fixture
def stopped(free_port: int) -> Iterator[Stopped]:
    stage = Stage(free_port)
    yield Stopped(stage)
    stage.close()


def test_a_stop_is_repeated_until_all_parts_have_reported_it_and_never_after_that(stopped: Stopped) -> None:
    """The parts report it for a moment only, because somebody releases the robot at once."""
    threading.Timer(2.5 * STOP_PERIOD, stopped.confirm).start()
    assert stopped.controls.do("p", "stop", {}) == "Stopped: all motors."
    repeated = stopped.sent
    assert repeated >= 2
    stopped.on_stop = stopped.confirm
    assert stopped.controls.do("p", "stop", {}) == "Stopped: all motors."
    time.sleep(2.0 * STOP_PERIOD)
    assert stopped.sent == repeated + 1


def test_a_stop_is_sent_although_all_parts_seem_to_report_it_already(stopped: Stopped) -> None:
    """Their newest states can be older than a release a moment ago."""
    stopped.known.stopped = float("inf")
    assert stopped.controls.do("p", "stop", {}) == "Stopped: all motors."
    wait_for(lambda: stopped.sent == 1, "the stop")


def test_a_release_ends_the_repetition_of_a_stop_that_was_not_confirmed(stopped: Stopped) -> None:
    stopped.on_stop = threading.Thread(target=stopped.controls.do, args=("other", "release", {})).start
    with pytest.raises(Refused, match="released the robot before all parts confirmed"):
        stopped.controls.do("p", "stop", {})
    assert stopped.sent == 1


def test_in_a_pause_the_confirmation_by_robot_sim_is_sufficient(stopped: Stopped) -> None:
    def confirm() -> None:
        stopped.known.confirmed = time.monotonic()

    stopped.on_stop = confirm
    assert stopped.controls.do("p", "stop", {}) == "Stopped: all motors, as robot_sim confirms."
    stopped.known.heard = float("inf")  # a part publishes its state, and is not stopped
    with pytest.raises(Refused, match="use the robot's own emergency button"):
        stopped.controls.do("p", "stop", {})


def test_a_stop_that_is_not_confirmed_is_said(stopped: Stopped) -> None:
    stopped.confirm()  # an earlier one
    with pytest.raises(Refused, match="use the robot's own emergency button"):
        stopped.controls.do("p", "stop", {})
