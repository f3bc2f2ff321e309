# SPDX-License-Identifier: Apache-2.0
"""An agent with targets as a process: the test plays the controller and the model."""

from __future__ import annotations

import signal
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION, keys
from bus_schema.messages import Event, Learned, Reach, Transition
from bus_schema.rpc import AddObject, Done, Empty, OneName, ReachFor, Started
from mobee import load_robot
from mobee.reach import TARGET
from mobee.store import STORE
from tests.services.fake_controller import FakeController
from tests.services.harness import Program, Refusal, Rig, rig, wait_for

ROBOT = load_robot("icub")
PLACES = ("-0.3", "0.2", "0.1", "-0.3", "0.3", "0.2")
MISSING = 0.02  # m


class FakeReaches(FakeController):
    """A controller whose reaches all end as near, and a model that takes targets."""

    def __init__(self, rig: Rig, part: str) -> None:
        self.reaches: list[ReachFor] = []
        self.presented: list[list[float]] = []
        self.removed: list[str] = []
        self.refusals: list[float] = []  # of targets, monotonic clock
        self.refuses = 0  # how many targets are refused because another service presents one
        self.pauses = 0  # how many reaches are refused because the robot is paused
        self._reach = rig.bus.publisher(Reach, part)
        rig.serve(keys.goal("*", "reach"), ReachFor, self._asked)
        rig.serve(keys.world_rpc("add"), AddObject, self._added)
        rig.serve(keys.world_rpc("remove"), OneName, self._removed)
        super().__init__(rig, part)

    def _added(self, request: AddObject, key: str) -> Done:
        assert (request.name, request.role) == (TARGET, "target")
        if len(self.refusals) < self.refuses:
            self.refusals.append(time.monotonic())
            raise Refusal("owned")
        self.presented.append(request.position)
        return Done(v=VERSION)

    def _removed(self, request: OneName, key: str) -> Done:
        self.removed.append(request.name)
        return Done(v=VERSION)

    def _asked(self, request: ReachFor, key: str) -> Started:
        with self._lock:
            if request.epoch != self.epoch:
                raise Refusal("epoch")
            if self.pauses:
                self.pauses -= 1
                raise Refusal("paused")
            self.reaches.append(request)
            self.action_id, self._target, self.start_k = request.action_id, self.q, self.rig.bus.k
            self._become("moving")
            return Started(v=VERSION, k=self.rig.bus.k)

    def _become(self, status: str) -> None:
        super()._become(status)
        if status == "settled" and self.reaches and self.reaches[-1].action_id == self.action_id:
            asked, k = self.reaches[-1], self.rig.bus.k
            over = {"action_id": asked.action_id, "phase": "over", "marker": asked.marker, "object": asked.object, "settled": True}
            q, at = self.q.tolist(), asked.position
            self._reach.put(end_k=k - 1, target=at, q=q, position=at, missing=MISSING, touched=["table"], **over)


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[tuple[Rig, FakeReaches]]:
    with rig(tmp_path, ROBOT) as made:
        controller = FakeReaches(made, "right_arm")
        (tmp_path / "run").mkdir()
        try:
            yield made, controller
        finally:
            controller.close()


def agent(made: Rig, *arguments: str) -> Program:
    given = ("--part", "right_arm", "--run-dir", str(made.folder / "run"), "--targets", *PLACES)
    return made.start("services.agents", "agent_right_arm", *given, *arguments)


def steps(made: Rig) -> list[dict[str, Any]]:
    with sqlite3.connect(made.folder / "run" / STORE, timeout=10.0) as database:
        database.row_factory = sqlite3.Row
        return [dict(row) for row in database.execute("SELECT * FROM reach_steps ORDER BY n")]


def test_every_action_is_on_disk_before_the_next_and_targets_take_turns(stage: tuple[Rig, FakeReaches]) -> None:
    made, controller = stage
    stored: list[int] = []
    controller.on_goal = lambda goal: stored.append(len(steps(made)))
    assert agent(made, "--tries", "4", "--strategy", "random").wait(60.0) == 0
    kept = steps(made)
    assert len(kept) == len(controller.goals) + len(controller.reaches)
    moves = [row["n"] - 1 for row in kept if row["a"] >= 0]
    assert stored == moves
    reached = [row for row in kept if row["a"] < 0]
    assert [row["problem"] for row in reached] in ([0, 1, 0, 1], [0, 1, 1, 0])
    assert all(row["missing"] == MISSING and row["reward"] == pytest.approx(1.0 / 3.0) for row in reached)
    assert {(asked.marker, asked.object, asked.stay) for asked in controller.reaches} == {("right_palm", TARGET, False)}
    assert [asked.position for asked in controller.reaches] == controller.presented


def test_transitions_are_published_with_the_model_of_them(stage: tuple[Rig, FakeReaches]) -> None:
    made, _ = stage
    transitions = made.record(Transition, "right_arm")
    learned = made.record(Learned, "right_arm")
    assert agent(made, "--tries", "4", "--strategy", "random").wait(60.0) == 0
    kept = [row for row in steps(made) if row["a"] >= 0]
    wait_for(lambda: len(transitions) >= len(kept) > 0 and learned, "the published transitions")
    assert [(seen.n, seen.s, seen.a, seen.s_next, seen.reward, seen.settled) for seen in transitions] == [
        (n, row["s"], row["a"], row["s_next"], row["reward"], bool(row["settled"])) for n, row in enumerate(kept, 1)
    ]
    first = learned[0]
    tries, value = np.frombuffer(first.tries, "<u4").reshape(81, 16), np.frombuffer(first.value, "<f4").reshape(81, 16)
    expected = np.zeros((81, 16), dtype=int)
    for row in kept[: first.n]:
        expected[row["s"], row["a"]] += 1
    np.testing.assert_array_equal(tries, expected)
    assert value.max() > 0.0 and first.agent == "right_arm"


def test_a_killed_agent_continues_with_its_model(stage: tuple[Rig, FakeReaches]) -> None:
    made, controller = stage
    events = made.record(Event, "agent_right_arm")
    first = agent(made)
    wait_for(lambda: len(controller.reaches) >= 3, "three reaches")
    assert first.stop(signal.SIGKILL) == -signal.SIGKILL
    before = steps(made)
    assert agent(made, "--tries", "6").wait(60.0) == 0
    assert steps(made)[: len(before)] == before
    assert sum(row["a"] < 0 for row in steps(made)) == 6
    wait_for(lambda: [event.code for event in events] == ["resumed"], "the event")


def test_an_agent_waits_while_another_service_presents_a_target(stage: tuple[Rig, FakeReaches]) -> None:
    made, controller = stage
    controller.refuses = 3
    assert agent(made, "--tries", "1", "--strategy", "random").wait(60.0) == 0
    assert len(controller.presented) == 1
    first, *later = controller.refusals
    assert later[-1] - first > 1.5  # two waits


def test_a_reach_waits_for_the_end_of_a_pause(stage: tuple[Rig, FakeReaches]) -> None:
    made, controller = stage
    controller.pauses = 2
    events = made.record(Event, "agent_right_arm")
    assert agent(made, "--tries", "1").wait(30.0) == 0
    assert (controller.pauses, len(controller.reaches)) == (0, 1)
    assert not [event for event in events if event.code == "interrupted"]


def test_an_agent_that_rests_leaves_the_target_to_others_and_presents_its_own_afterwards(stage: tuple[Rig, FakeReaches]) -> None:
    made, controller = stage
    agent(made)
    wait_for(lambda: controller.reaches, "a reach")
    made.call(keys.service_rpc("agent_right_arm", "rest"), Empty, Done, who="monitor")
    assert controller.removed == [TARGET]
    presented, reached = len(controller.presented), len(controller.reaches)
    made.call(keys.service_rpc("agent_right_arm", "resume"), Empty, Done, who="monitor")
    wait_for(lambda: len(controller.reaches) > reached, "the next reach")
    assert len(controller.presented) > presented


def test_an_unknown_predictor_is_reported_in_one_line(stage: tuple[Rig, FakeReaches]) -> None:
    made, _ = stage
    program = made.spawn(
        "-m", "services.agents", "--endpoint", made.endpoint, "--part", "right_arm", "--targets", *PLACES, "--predictor", "wieghted"
    )
    assert program.wait(60.0) == 2
    assert "Did you mean 'weighted'?" in program.says
    assert "Traceback" not in program.says
