# SPDX-License-Identifier: Apache-2.0
"""The gaze as a process: the test plays the robot, the controller and vision."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import pytest

from bus_schema import decode
from bus_schema.messages import Event, Follow, Geometry, PartStatus, Tick, WorldObject
from mobee import load_robot
from mobee.arrays import Array
from mobee.behaviours.gaze import Gaze
from mobee.errors import InvalidValue, UnknownName
from mobee.robot.cameras import cameras_of
from services.gaze.config import Config
from tests.services.fake_controller import FakeController
from tests.services.harness import Program, Rig, rig, wait_for

ROBOT = load_robot("icub")
HEAD, TORSO = ROBOT.part("head").slice, ROBOT.part("torso").slice
AHEAD = np.array([-0.45, 0.1, 0.2])
DT_NS = 10_000_000  # of FakeController


class FakeHead(FakeController):
    """The robot with its controller: the head is where its attractor is; vision sees the target in every sixth tick."""

    def __init__(self, made: Rig) -> None:
        self.target: Array | None = None
        self.follows: list[Follow] = []
        self.posture = ROBOT.home.copy()
        self._ticks, self._places = made.bus.publisher(Tick), made.bus.publisher(WorldObject, "ball")
        super().__init__(made, "head", period=0.004)
        made.listen(
            Follow.stream.key("head"), lambda sample: self._obey(decode(Follow, sample.payload.to_bytes(), str(sample.encoding), part=6))
        )

    def _obey(self, follow: Follow) -> None:
        with self._lock:
            self.follows.append(follow)
            if follow.epoch == self.epoch and self.status != "held":
                self.q = np.array(follow.q)

    def _tick(self) -> None:
        super()._tick()
        bus = self.rig.bus
        self.posture[HEAD] = self.q
        state = PartStatus(bus.k, bus.t, "velocity", "armed", 0, 1, 0, 1)
        self._ticks.put(dt=DT_NS, mode="free", rate=1.0, q=self.posture.tolist(), parts=dict.fromkeys(ROBOT.parts, state))
        if self.target is not None and bus.k % 6 == 0:
            self._places.put(
                name="ball",
                geometry=Geometry("sphere", [0.03]),
                position=self.target.tolist(),
                quaternion=[1.0, 0.0, 0.0, 0.0],
                covariance=[0.0] * 9,
                role="target",
                t_capture=max(0, bus.t - 50_000_000),
                valid_until=bus.t + 5_000_000_000,
            )

    def error(self, target: Array) -> float:
        """The larger angle between a direction of view and the target, degrees."""
        return float(np.rad2deg(Gaze(ROBOT, cameras_of(ROBOT), "head").error(self.posture, target)))


@dataclass
class Stage:
    rig: Rig
    head: FakeHead
    events: list[Event]
    program: Program = field(init=False)
    last: int = 0

    def said(self, code: str) -> str:
        """The next event of the gaze with that code."""

        def found() -> Event | None:
            return next((event for event in self.events[self.last :] if event.code == code), None)

        event = wait_for(found, f"the event {code}")
        self.last = self.events.index(event) + 1
        return event.text


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    with rig(tmp_path_factory.mktemp("gaze"), ROBOT) as made:
        head = FakeHead(made)
        staged = Stage(made, head, made.record(Event, "gaze"))
        staged.program = made.start("services.gaze", "gaze", "--gains", "default", "--release-after", "2")
        try:
            yield staged
        finally:
            head.close()


def test_without_a_target_the_part_is_left_alone(stage: Stage) -> None:
    begun = stage.rig.bus.k
    wait_for(lambda: stage.rig.bus.k > begun + 50, "ticks")
    assert stage.head.takes == 0 and not stage.head.follows
    assert "pauses: no place of ball" in stage.rig.stat("gaze").text


def test_the_head_turns_to_the_target_and_the_gaze_says_so(stage: Stage) -> None:
    stage.head.target = AHEAD
    assert stage.said("gaze_follows") == "gaze follows ball"
    wait_for(lambda: stage.head.error(AHEAD) < 1.0, "the target in both centres")
    assert stage.rig.stat("gaze").text == "follows ball"


def test_a_stale_target_pauses_the_gaze_which_stays_directed_at_its_last_place_and_later_releases_the_part(stage: Stage) -> None:
    """As when the camera is gone, the light is out, or something hides the target."""
    stage.head.target = None
    assert "no place of ball for 0.6 s" in stage.said("gaze_pauses")
    stage.head.posture[TORSO] = ROBOT.home[TORSO] + 0.05  # somebody else moves the torso
    assert stage.head.error(AHEAD) > 2.0
    wait_for(lambda: stage.head.error(AHEAD) < 1.0, "the last place in both centres")
    wait_for(lambda: np.abs(stage.head.follows[-1].dq).max() < 0.02, "the head at rest")
    assert stage.head.owner
    wait_for(lambda: stage.head.owner == "", "the release")
    stage.head.posture[TORSO] = ROBOT.home[TORSO]
    stage.head.target = AHEAD
    assert stage.said("gaze_follows")


def test_a_part_that_an_agent_took_is_taken_again_when_it_is_free(stage: Stage) -> None:
    with stage.head._lock:
        stage.head.epoch, stage.head.owner, stage.head.owner_name = stage.head.epoch + 1, "another", "agent_head"
    assert "belongs to agent_head" in stage.said("gaze_pauses")
    taken, begun = stage.head.takes, stage.rig.bus.k
    wait_for(lambda: stage.rig.bus.k > begun + 150, "ticks")
    assert stage.head.takes == taken and stage.head.owner == "another"  # it did not even ask
    with stage.head._lock:
        stage.head.owner = ""
    assert stage.said("gaze_follows")


def test_a_part_in_hold_pauses_the_gaze_which_continues_from_where_the_part_is(stage: Stage) -> None:
    stage.head.hold()
    assert "head is in hold" in stage.said("gaze_pauses")
    with stage.head._lock:
        stage.head.q = ROBOT.home[HEAD]
    stage.head.follows.clear()
    stage.head.resume()
    stage.said("gaze_follows")
    first = wait_for(lambda: stage.head.follows and stage.head.follows[0], "the first goal")
    assert np.abs(np.array(first.q) - ROBOT.home[HEAD]).max() < 0.05


def test_the_gaze_continues_in_a_new_run_and_with_a_new_controller(stage: Stage) -> None:
    stage.head.new_run()
    stage.said("gaze_follows")
    stage.head.restart()
    wait_for(lambda: stage.head.owner == next(iter(stage.rig.instances("gaze"))), "the goal at the new controller")


def test_a_robot_that_cannot_look_is_refused() -> None:
    with pytest.raises(InvalidValue, match="left_arm of 'icub' turns none of the cameras"):
        Config(part="left_arm").check_robot(ROBOT)
    with pytest.raises(UnknownName, match="tail"):
        Config(part="tail").check_robot(ROBOT)
    with pytest.raises(InvalidValue, match="cannot see"):
        Config().check_robot(load_robot("katana"))
