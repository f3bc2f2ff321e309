# SPDX-License-Identifier: Apache-2.0
"""A curious agent as a process: the test plays the controller and reads the disk."""

from __future__ import annotations

import signal
import sqlite3
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import encoding_of, keys
from bus_schema.messages import Clock, Decision, EStop, Event, Motion, Transition
from bus_schema.rpc import Done, Empty, Explore, Goal
from mobee import Lattice, load_robot
from mobee.errors import UnknownName
from mobee.store import STORE, TransitionStore
from services.agents.config import Config
from services.common.rpc import CallFailed
from tests.services.an_explorer import last_action
from tests.services.fake_controller import FakeController
from tests.services.harness import Program, Rig, rig, wait_for

ROBOT = load_robot("icub")
TORSO = Lattice(ROBOT, ROBOT.part("torso").motors, neighbours=8)


@dataclass
class Stage:
    rig: Rig
    controller: FakeController
    folder: Path
    transitions: list[Transition]
    events: list[Event]

    def agent(self, *arguments: str, part: str = "torso") -> Program:
        return self.rig.start("services.agents", f"agent_{part}", "--part", part, "--run-dir", str(self.folder), *arguments)

    def refused(self, *arguments: str) -> tuple[int, str]:
        """Exit code and last words of an agent that cannot begin."""
        program = self.rig.spawn("-m", "services.agents", "--endpoint", self.rig.endpoint, *arguments)
        code = program.wait(20.0)
        assert "Traceback" not in program.says
        return code, program.says

    def rows(self) -> list[dict[str, Any]]:
        return rows(self.folder)

    def made(self, n: int) -> list[Transition]:
        return wait_for(lambda: len(self.transitions) >= n and list(self.transitions), f"{n} transitions")

    def texts(self, code: str) -> list[str]:
        return [e.text for e in self.events if e.code == code]


def rows(folder: Path) -> list[dict[str, Any]]:
    file = folder / "transitions.sqlite"
    if not file.exists():
        return []
    with sqlite3.connect(file, timeout=10.0) as database:
        database.row_factory = sqlite3.Row
        return [dict(row) for row in database.execute("SELECT * FROM transitions ORDER BY n")]


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    with rig(tmp_path, ROBOT) as made:
        transitions = made.record(Transition, "torso")
        events = made.record(Event, "agent_torso")
        controller = FakeController(made, "torso")
        folder = tmp_path / "run"
        folder.mkdir()
        try:
            yield Stage(made, controller, folder, transitions, events)
        finally:
            controller.close()


def test_every_transition_is_on_disk_before_the_next_goal_and_published_as_stored(stage: Stage) -> None:
    stored: list[int] = []
    stage.controller.on_goal = lambda goal: stored.append(len(stage.rows()))
    stage.controller.touched = ["table"]
    program = stage.agent("--transitions", "12")
    assert program.wait(30.0) == 0
    assert stored == list(range(12))
    published, kept = stage.made(12), stage.rows()
    assert [t.n for t in published] == list(range(1, 13))
    for message, row, goal in zip(published, kept, stage.controller.goals, strict=True):
        same = ("n", "s", "a", "s_next", "reward", "settled", "duration")
        assert [getattr(message, name) for name in same] == [row[name] for name in same]
        assert (message.agent, row["agent"], message.touched) == ("torso", "torso", ["table"])
        assert message.goal == TORSO.goal(message.s, message.a)
        np.testing.assert_allclose(goal.q, TORSO.target(message.goal), atol=1e-12)
        assert message.duration == pytest.approx(0.05)  # the five ticks of the controller
    for before, after in zip(published, published[1:], strict=False):
        assert after.s == before.s_next
    assert stage.controller.takes == 1


def test_where_it_arrives_is_judged_by_the_encoders_and_not_by_the_goal(stage: Stage) -> None:
    stage.controller.miss = -0.6
    stage.agent("--transitions", "5")
    for t, goal in zip(stage.made(5), stage.controller.goals, strict=False):
        assert t.s_next == TORSO.state_of(np.array(goal.q) - 0.6)
    assert any(t.s_next != t.goal for t in stage.transitions)


def test_a_timeout_is_an_observation_too(stage: Stage) -> None:
    stage.controller.ending = "timeout"
    stage.agent("--transitions", "3").wait(30.0)
    assert [(t.settled, row["settled"]) for t, row in zip(stage.made(3), stage.rows(), strict=True)] == [(False, 0)] * 3


def test_a_hold_interrupts_the_action_nothing_is_stored_and_it_continues_later(stage: Stage) -> None:
    agent = stage.agent()
    stage.made(2)
    stage.controller.ending = "held"
    wait_for(lambda: stage.texts("interrupted"), "the event")
    assert "in hold" in stage.texts("interrupted")[0]
    before, goals = len(stage.rows()), len(stage.controller.goals)
    ticks = stage.rig.bus.k
    wait_for(lambda: stage.rig.bus.k > ticks + 50, "time to pass")
    assert (len(stage.rows()), len(stage.controller.goals)) == (before, goals)
    assert len(stage.texts("interrupted")) == 1
    stage.controller.ending = "settled"
    stage.controller.q = TORSO.target(0)  # it may have moved since
    stage.controller.resume()
    resumed = stage.made(before + 2)[before]
    assert (resumed.n, resumed.s) == (before + 1, 0)
    assert stage.rig.stat("agent_torso").numbers["interrupted"] == 1
    assert agent.is_running


def under_way(stage: Stage) -> int:
    """Start an agent, let an action that does not end touch the table, and return the number of transitions before it."""
    stage.agent()
    stage.made(2)
    stage.controller.lasts, stage.controller.touched = 1_000_000, ["table"]
    wait_for(lambda: stage.controller.status == "moving", "an action")
    ticks = stage.rig.bus.k
    wait_for(lambda: stage.rig.bus.k > ticks + 20, "some ticks of it")
    return len(stage.rows())


def test_an_action_continues_with_a_new_controller(stage: Stage) -> None:
    before, old = under_way(stage), stage.controller.epoch
    stage.controller.restart()
    stage.controller.lasts, stage.controller.touched = 5, []
    continued = stage.made(before + 3)[before]
    assert stage.controller.takes == 2
    assert stage.controller.epoch > old
    first, again = stage.controller.goals[before : before + 2]
    assert (first.action_id, first.q) == (again.action_id, again.q)
    assert continued.touched == ["table"]
    assert continued.duration > 20 * 0.01
    assert [row["n"] for row in stage.rows()][: before + 3] == list(range(1, before + 4))
    assert stage.texts("interrupted") == []
    assert stage.texts("sent_again") == ["torso continues its action with the new controller"]


@pytest.mark.parametrize("cause", ["emergency stop", "long hold"])
def test_an_action_does_not_continue_with_a_new_controller_after(stage: Stage, cause: str) -> None:
    before = under_way(stage)
    if cause == "emergency stop":
        stage.rig.bus.publisher(EStop).put(set=True, source="test", reason="a test")
        stage.rig.stat("agent_torso")  # is answered after the stop was handled
    stage.controller.restart()
    stage.controller.lasts = 5
    if cause == "long hold":
        stage.controller.hold()
        begin = stage.rig.bus.t
        wait_for(lambda: stage.rig.bus.t > begin + 10e9, "10 s of the bus clock")
        stage.controller.resume()
    stage.made(before + 2)
    assert "cannot continue" in wait_for(lambda: stage.texts("interrupted"), "the event")[0]
    assert stage.texts("sent_again") == []
    first, following = stage.controller.goals[before : before + 2]
    assert first.action_id != following.action_id


def test_a_new_run_ends_the_action_without_an_observation(stage: Stage) -> None:
    stage.agent()
    stage.made(2)
    stage.controller.lasts = 1_000_000
    wait_for(lambda: stage.controller.status == "moving", "an action")
    before = len(stage.made(2))
    lost = stage.controller.action_id
    stage.controller.lasts = 5
    stage.controller.new_run()
    stage.made(before + 2)
    assert "new run" in wait_for(lambda: stage.texts("interrupted"), "the event")[0]
    assert stage.controller.action_id != lost
    assert stage.controller.takes == 1  # the goal is still its own


def test_an_answer_that_gets_lost_does_not_make_a_second_action(stage: Stage) -> None:
    stage.controller.loses_answers = 2
    stage.agent("--transitions", "3").wait(30.0)
    assert len(stage.made(3)) == len(stage.controller.goals) == 3
    assert stage.texts("interrupted") == []


def test_after_each_kill_it_continues(stage: Stage, rng: np.random.Generator) -> None:
    first: list[dict[str, Any]] = []
    for _ in range(3):
        agent, count = stage.agent(), len(stage.transitions)
        stage.made(count + 3)
        time.sleep(rng.uniform(0.0, 0.1))
        assert agent.stop(signal.SIGKILL) == -signal.SIGKILL
        before, first = first, stage.rows()
        assert first[: len(before)] == before and len(first) >= len(before) + 3
        published = [t.n for t in stage.transitions]
        assert published == sorted(set(published))
        assert set(published) <= {row["n"] for row in first}  # the kill may come before the last row is published
    count = len(stage.transitions)
    again = stage.agent("--transitions", str(len(first) + 4))
    assert again.wait(30.0) == 0
    both = stage.rows()
    assert both[: len(first)] == first
    assert [row["n"] for row in both] == list(range(1, len(first) + 5))
    last = [len(first) + n for n in range(1, 5)]
    wait_for(lambda: [t.n for t in stage.transitions[count:]][-4:] == last, "the last four transitions")
    wait_for(lambda: any(f"continues after {len(first)} transitions" in text for text in stage.texts("resumed")), "the event")


def test_a_resumed_agent_has_learnt_what_the_one_before_had(stage: Stage, tmp_path: Path) -> None:
    """The same agent, once in one go and once killed in between, chooses and values alike."""
    (tmp_path / "other").mkdir()
    in_one_go = stage.agent("--transitions", "14", "--seed", "3", "--run-dir", str(tmp_path / "other"))
    assert in_one_go.wait(30.0) == 0
    whole = [(t.s, t.a, t.s_next, t.reward, t.value) for t in stage.made(14)]
    stage.transitions.clear()
    limits = ROBOT.limits[ROBOT.part("torso").slice]
    stage.controller.q = limits.mean(axis=1)  # from the same posture
    for end in ("7", "14"):
        assert stage.agent("--transitions", end, "--seed", "3").wait(30.0) == 0
    assert [(t.s, t.a, t.s_next, t.reward, t.value) for t in stage.made(14)] == whole


def test_an_agent_continues_what_was_learned_elsewhere(stage: Stage, tmp_path: Path) -> None:
    assert stage.agent("--transitions", "6").wait(30.0) == 0
    (tmp_path / "other").mkdir()
    there = ("--run-dir", str(tmp_path / "other"), "--continues", str(stage.folder))
    assert stage.agent("--transitions", "9", *there).wait(30.0) == 0
    assert [row["s_next"] for row in rows(tmp_path / "other")[:6]] == [row["s_next"] for row in stage.rows()]
    assert len(rows(tmp_path / "other")) == 9
    with TransitionStore(tmp_path / "other" / STORE, "torso", read_only=True) as store:
        assert store.settings()["continued"]["transitions"] == 6


def test_an_agent_with_a_goal_goes_there_and_records_its_settings(stage: Stage) -> None:
    given = ("--goal", "26", "--beliefs", "debiased", "--divergence", "kl", "--forgetting", "0.9", "--tolerance", "0.001")
    assert stage.agent(*given, "--transitions", "8").wait(30.0) == 0
    assert any(t.s == 26 for t in stage.made(8))
    with TransitionStore(stage.folder / STORE, "torso") as store:
        settings = store.settings()
    assert settings["goal"]["weight"] is None
    assert [settings[name] for name in ("beliefs", "divergence", "forgetting", "tolerance")] == ["debiased", "kl", 0.9, 0.001]


def test_an_explorer_of_the_user_explores_live(stage: Stage) -> None:
    assert stage.agent("--explorer", f"{last_action.__module__}:last_action", "--transitions", "3").wait(30.0) == 0
    assert all(t.a == len(TORSO.actions(t.s)) - 1 for t in stage.made(3))


def test_an_unknown_explorer_is_refused_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'curious'"):
        Config(explorer="curios").check_robot(ROBOT)


def test_an_arm_has_four_joints_sixteen_neighbours_and_its_other_motors_at_rest(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as made:
        controller = FakeController(made, "right_arm")
        try:
            transitions = made.record(Transition, "right_arm")
            made.start("services.agents", "agent_right_arm", "--part", "right_arm")
            wait_for(lambda: len(transitions) >= 3, "transitions")
        finally:
            controller.close()
        low, high = ROBOT.limits[ROBOT.part("right_arm").slice].T
        goals = np.array([goal.q for goal in controller.goals])
        np.testing.assert_allclose(goals[:, 4:], np.tile((low + 0.5 * (high - low))[4:], (len(goals), 1)), atol=1e-12)
        fractions = ((goals - low) / (high - low))[:, :4]
        assert set(np.round(fractions, 9).ravel()) <= {0.25, 0.5, 0.75}
        assert max(t.goal for t in transitions) < 81
        assert all(0 <= t.a < 16 for t in transitions)


def test_its_numbers_count_from_the_mark(stage: Stage) -> None:
    stage.agent("--transitions", "0")
    stage.made(3)
    stage.controller.hold()
    wait_for(lambda: stage.texts("interrupted"), "the hold")
    numbers = stage.rig.stat("agent_torso").numbers
    assert numbers["transitions"] == numbers["transitions_ever"] == len(stage.rows())
    assert numbers["action_time_mean"] == pytest.approx(0.05)
    stage.rig.call(keys.service_rpc("agent_torso", "mark"), Empty, Done)
    numbers = stage.rig.stat("agent_torso").numbers
    assert (numbers["transitions"], numbers["interrupted"], numbers["action_time_mean"]) == (0, 0, None)
    assert numbers["transitions_ever"] == len(stage.rows())


# Messages and settings, and how an agent ends


def test_an_absent_run_directory_is_reported_in_one_line(stage: Stage) -> None:
    code, says = stage.refused("--part", "torso", "--run-dir", str(stage.folder / "none"))
    assert code == 1
    assert says.count("\n") == 1
    assert "none/transitions.sqlite" in says
    assert "check that its folder exists" in says


def test_a_run_of_other_settings_is_not_continued(stage: Stage) -> None:
    stage.agent("--transitions", "2").wait(30.0)
    code, says = stage.refused("--part", "torso", "--run-dir", str(stage.folder), "--explorer", "random")
    assert code == 1
    assert 'explorer = "curious" on record, now "random"' in says
    assert len(stage.rows()) == 2


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--part", "left_amr"), "Did you mean 'left_arm'?"),
        (("--part", "torso", "--joints", "torso_yam"), "Did you mean 'torso_yaw'?"),
        (("--part", "torso", "--levels", "0.5", "0.25"), "levels"),
    ],
)
def test_a_wrong_setting_is_reported_in_one_line(stage: Stage, arguments: tuple[str, ...], says: str) -> None:
    code, text = stage.refused(*arguments)
    assert code == 2
    assert says in text


def test_a_second_agent_of_a_part_gives_up_and_the_first_continues(stage: Stage) -> None:
    first = stage.agent()
    stage.made(2)
    stage.controller.period = 0.01
    code, says = stage.refused("--part", "torso")
    assert code == 1
    assert "owned" in says
    before = len(stage.rows())
    stage.made(before + 2)
    assert first.is_running
    assert stage.controller.takes == 1


def test_it_waits_for_a_controller_and_ends_at_once_when_stopped(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as made:
        agent = made.start("services.agents", "agent_torso", "--part", "torso")
        assert made.stat("agent_torso").numbers["transitions"] == 0
        transitions = made.record(Transition, "torso")
        controller = FakeController(made, "torso")
        try:
            wait_for(lambda: transitions, "a transition")
            controller.lasts = 1_000_000
            wait_for(lambda: controller.status == "moving", "an action")
            start = time.monotonic()
            assert agent.stop() == 0
            print(f"ended {time.monotonic() - start:.2f} s after SIGTERM, in the middle of an action")
            alone = made.start("services.agents", "agent_torso", "--part", "torso")
        finally:
            controller.close()
            made.drop_token("controller", controller.instance)
        start = time.monotonic()
        assert alone.stop() == 0
        print(f"ended {time.monotonic() - start:.2f} s after SIGTERM, without a controller")


def test_random_bytes_do_it_no_harm(stage: Stage, rng: np.random.Generator) -> None:
    agent = stage.agent()
    stage.made(2)
    targets = [(Motion.stream.key("torso"), Motion), (Clock.stream.key(), Clock)]

    def are_refused() -> int:
        """Send more messages: the agent reads only the newest of those between two reads, which may be a valid one."""
        for n in range(200):
            key, cls = targets[n % 2]
            stage.rig.session.put(key, rng.bytes(int(rng.integers(0, 300))), encoding=encoding_of(cls if n % 3 else Goal))
        return stage.rig.stat("agent_torso").rejected

    wait_for(are_refused, "the refusals")
    stage.made(len(stage.transitions) + 3)
    assert agent.is_running


def test_an_agent_that_is_asked_to_rest_releases_its_goal_and_continues_later(stage: Stage) -> None:
    agent = stage.agent()
    n = len(stage.made(2))
    stage.rig.call(keys.service_rpc("agent_torso", "rest"), Empty, Done)
    assert stage.controller.owner == ""
    before = len(stage.rows())  # on disk; a message of the last one may still be on its path
    time.sleep(1.0)
    assert len(stage.rows()) == before
    assert "agent rests" in stage.texts("rests")[0]
    stage.rig.call(keys.service_rpc("agent_torso", "resume"), Empty, Done)
    assert len(stage.made(before + 1)) > n
    agent.stop()


def test_its_explorer_is_changed_on_request_and_kept_after_a_kill(stage: Stage) -> None:
    decisions = stage.rig.record(Decision, "torso")
    first = stage.agent()
    stage.made(2)
    explore = keys.service_rpc("agent_torso", "explore")
    with pytest.raises(CallFailed, match="valid: curious, random"):
        stage.rig.call(explore, Explore, Done, explorer="os:getcwd")
    stage.rig.call(explore, Explore, Done, explorer="random")
    wait_for(lambda: decisions[-1].explorer == "random", "a decision of the new explorer")
    first.process.send_signal(signal.SIGKILL)
    first.wait(20.0)
    known = len(decisions)
    stage.agent()
    wait_for(lambda: len(decisions) > known, "a decision after the kill")
    assert {one.explorer for one in decisions[known:]} == {"random"}
    with TransitionStore(stage.folder / STORE, "torso", read_only=True) as store:
        assert store.settings()["explorer"] == "curious"
        assert list(store.explorers().values()) == ["random"]
