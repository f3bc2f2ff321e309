"""The controller as a process: the test plays robot_sim, the model and the agents."""

from __future__ import annotations

import itertools
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.chain import Tick
from bus_schema.messages import Command, EStop, Event, Forces, Motion
from bus_schema.rpc import Done, Empty, Force, Goal, Started, Take, Taken, WithEpoch
from mobee import Controller, Gains, Model, load_robot
from mobee.control import Forces as Acting
from mobee.robot.robot import Array
from services.common.rpc import CallFailed
from tests.services.harness import FakeModel, FakeSim, Program, Rig, rig, wait_for

ROBOT = load_robot("icub")
PARTS = tuple(ROBOT.parts)
HEAD = [-0.3, 0.0, 0.1, 0.0, 0.0, 0.0]
SETTLE = Gains.published_2014().settle


@dataclass
class Stage:
    """The controller under test and what it says."""

    rig: Rig
    sim: FakeSim
    model: FakeModel
    controller: Program
    motions: dict[str, list[Motion]]
    owned: list[tuple[str, str]] = field(default_factory=list)
    names: Iterator[int] = field(default_factory=lambda: itertools.count(1))

    def motion(self, part: str) -> Motion:
        return self.motions[part][-1]

    def answered(self, k: int) -> bool:
        run = self.rig.bus.run
        return all(m and m[-1].k == k and m[-1].run == run for m in self.motions.values())

    def tick(self, **how: Any) -> int:
        k = self.sim.tick(**how)
        wait_for(lambda: self.answered(k), f"motion {k}")
        return k

    def ticks(self, n: int) -> None:
        for _ in range(n):
            self.tick()

    def play(self, until: Callable[[], Any], what: str, ticks: int = 3000) -> Any:
        return self.sim.play(until, what, self.answered, ticks)

    def statuses(self) -> set[str]:
        return {self.motion(part).status for part in PARTS}

    def under_control(self) -> None:
        def reached() -> bool:
            known = all(motions and motions[-1].run == self.rig.bus.run for motions in self.motions.values())
            return known and self.statuses() == {"idle"}

        self.play(reached, "all parts under control")

    def own(self, part: str, who: str = "agent_test") -> tuple[str, int]:
        """A new agent that owns the part's goal: its instance and epoch."""
        instance = f"n{next(self.names)}"
        self.rig.token(who, instance)
        self.owned.append((who, instance))
        return instance, wait_for(lambda: self.take(part, instance, who), "the goal")

    def take(self, part: str, instance: str, who: str = "agent_test") -> int | None:
        """None while the controller has not seen the token."""
        try:
            return int(self.rig.call(keys.goal(part, "take"), Take, Taken, who=who, instance=instance).epoch)
        except CallFailed as error:
            if error.code == "token":
                return None
            raise

    def leave(self, who: str, instance: str) -> None:
        self.owned.remove((who, instance))
        self.rig.drop_token(who, instance)

    def goal(self, part: str, epoch: int, q: Array, action: str = "a") -> Started:
        return self.rig.call(keys.goal(part, "goal"), Goal, Started, epoch=epoch, action_id=action, q=[float(x) for x in q])

    def force(self, part: str, epoch: int, **fields: Any) -> None:
        self.rig.call(keys.goal(part, "force"), Force, Done, epoch=epoch, **fields)

    def commands(self, part: str, since: int = 0) -> list[Command]:
        return [c for c in self.sim.commands[part] if c.run == self.rig.bus.run and c.re_k > since]

    def numbers(self) -> dict[str, float]:
        return self.rig.stat("controller").numbers


def staged(made: Rig, *arguments: str) -> Stage:
    sim, model = FakeSim(made), FakeModel(made)
    motions = {part: made.record(keys.motion(part), Motion, part) for part in PARTS}
    return Stage(made, sim, model, made.start("services.controller", "controller", *arguments), motions)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    folder = tmp_path_factory.mktemp("controller")
    settings = folder / "controller.toml"
    settings.write_text(f"[posture]\nhead = {HEAD}\n")
    with rig(folder, ROBOT) as made:
        yield staged(made, "--config", str(settings))


@pytest.fixture
def run(stage: Stage) -> Iterator[Stage]:
    """The stage in a new run with all parts under control."""
    stage.sim.frozen, stage.sim.silent, stage.sim.refuses_to_arm = False, set(), set()
    stage.model.silent, stage.model.behind, stage.model.touched, stage.model.part_age = False, 0, {}, dict.fromkeys(PARTS, 0)
    stage.model.collision[:] = 0.0
    stage.sim.new_run()
    stage.under_control()
    stage.rig.call(keys.service_rpc("controller", "mark"), Empty, Done)
    yield stage
    for who, instance in list(stage.owned):
        stage.leave(who, instance)


def near(part: str, shift: float = 0.3) -> Array:
    """A legal posture of the part, some way from home."""
    p = ROBOT.part(part)
    low, high = ROBOT.limits[p.slice].T
    return np.clip(ROBOT.home[p.slice] + shift, low + 0.2 * (high - low), high - 0.2 * (high - low))


def refused(code: str, call: Callable[[], Any]) -> str:
    with pytest.raises(CallFailed) as caught:
        call()
    assert caught.value.code == code
    return str(caught.value)


# Commands


def test_every_part_is_taken_armed_and_commanded_from_rest(run: Stage) -> None:
    run.ticks(10)
    for part in PARTS:
        gate, commands = run.sim.gates[part], run.commands(part)
        assert (gate.state, gate.owner) == ("armed", *run.rig.instances("controller"))
        assert {(c.epoch, c.mode, c.ttl) for c in commands} == {(gate.epoch, "velocity", 100)}
        step = np.array([m.max_acceleration for m in ROBOT.motor_table[ROBOT.part(part).slice]]) * 0.01
        assert (np.abs(commands[0].ref) <= step).all()
        assert np.diff([c.seq for c in commands]).min() == 1


def test_every_tick_is_answered_once_with_its_number(run: Stage) -> None:
    since = run.rig.bus.k
    run.ticks(20)
    wanted = list(range(since + 1, since + 21))
    for part in PARTS:
        wait_for(lambda part=part: len(run.commands(part, since)) == 20, "the commands")
        assert [c.re_k for c in run.commands(part, since)] == wanted
        assert [c.k for c in run.commands(part, since)] == wanted
        assert [m.k for m in run.motions[part] if m.run == run.rig.bus.run and m.k > since] == wanted
    assert run.numbers()["late_forces"] == 0
    assert run.rig.stat("controller").text == "4 of 4 parts under control"


def test_commands_stay_within_velocity_and_acceleration_limits_all_along(run: Stage) -> None:
    run.model.collision[:] = 20.0
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm", 0.8))
    run.ticks(60)
    run.model.collision[:] = -20.0
    run.ticks(60)
    moved = 0.0
    for part in PARTS:
        motors = ROBOT.motor_table[ROBOT.part(part).slice]
        refs = np.array([c.ref for c in run.commands(part)])
        moved = max(moved, np.abs(refs).max())
        assert (np.abs(refs) <= [m.max_velocity for m in motors]).all()
        assert (np.abs(np.diff(refs, axis=0)) <= np.array([m.max_acceleration for m in motors]) * 0.01).all()
    assert moved > 0.5  # else this test shows nothing


def test_the_law_is_the_librarys_and_its_time_step_is_the_difference_of_k(run: Stage) -> None:
    run.sim.frozen = True
    _, epoch = run.own("left_arm")
    law = Controller(Model(ROBOT), Gains.published_2014())
    law.reset(run.sim.q)
    run.tick()
    run.goal("left_arm", epoch, near("left_arm"))
    law.set_attractor("left_arm", near("left_arm"))
    force = Acting(np.zeros(41), np.zeros(41), np.full(41, 0.5))
    run.model.collision[:] = 0.5
    where = ROBOT.part("left_arm").slice
    for skip in (0, 0, 1, 2, 0, 7, 0):  # a gap is stepped over tick by tick, but three at most
        run.tick(skip=skip)
        for _ in range(min(skip + 1, 3)):
            expected = law.step(run.sim.q, 0.01, force)
        last = wait_for(lambda: run.commands("left_arm", run.rig.bus.k - 1), "the command")[-1]
        np.testing.assert_allclose(last.ref, expected.velocity[where], atol=1e-12)


def test_forces_that_do_not_come_in_half_a_tick_are_replaced_by_the_last(run: Stage) -> None:
    run.model.collision[:] = 5.0
    run.ticks(30)
    before = np.array(run.commands("torso")[-1].ref)
    run.model.silent = True
    for _ in range(3):
        start = time.monotonic()
        k = run.tick()
        assert time.monotonic() - start > 0.0045  # the wait
        command = wait_for(lambda k=k: run.commands("torso", k - 1), "the command")[-1]
        assert (command.re_k, command.mode) == (k, "velocity")
    assert (np.array(command.ref) * before > 0).all()  # the force of k-1 still acts
    assert run.numbers()["late_forces"] == 3
    assert run.statuses() == {"idle"}


def test_without_forces_for_longer_than_three_ticks_the_robot_holds_and_no_action_ends(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm"), "interrupted")
    run.ticks(10)
    run.model.silent = True
    run.ticks(3)
    assert run.motion("left_arm").status == "moving"
    k = run.tick()
    assert {(run.motion(p).status, run.motion(p).since_k) for p in PARTS} == {("held", k)}
    assert run.motion("left_arm").action_id == "interrupted"
    for part in PARTS:
        assert wait_for(lambda part=part: run.commands(part, k - 1), "the command")[-1].mode == "hold"
    refused("held", lambda: run.goal("left_arm", epoch, near("left_arm")))
    refused("held", lambda: run.force("left_arm", epoch, f=[1.0] * 16))
    run.force("left_arm", epoch)  # clearing is always right
    run.ticks(150)  # beyond any look of the settle test
    assert run.statuses() == {"held"}
    assert "settled" not in {m.status for m in run.motions["left_arm"] if m.action_id == "interrupted"}
    run.model.silent = False
    k = run.tick()
    motion = run.motion("left_arm")
    assert (motion.status, motion.action_id, motion.since_k) == ("idle", "", k)
    np.testing.assert_allclose(motion.goal, run.sim.of("left_arm"), atol=1e-12)
    command = wait_for(lambda: run.commands("left_arm", k - 1), "the command")[-1]
    np.testing.assert_allclose(command.ref, 0.0, atol=1e-12)


def test_forces_that_lag_by_more_than_three_ticks_are_no_forces(run: Stage) -> None:
    run.model.behind = 3
    run.ticks(10)
    assert run.statuses() == {"idle"}
    run.model.behind = 4
    run.ticks(2)
    assert run.statuses() == {"held"}


def test_forces_of_a_posture_in_which_one_part_is_old_are_no_forces(run: Stage) -> None:
    run.model.part_age = dict.fromkeys(PARTS, 20_000_000) | {"left_arm": 100_000_000}
    run.ticks(10)
    assert run.statuses() == {"idle"}
    run.model.part_age["left_arm"] += 1
    run.ticks(2)
    assert run.statuses() == {"held"}
    del run.model.part_age["left_arm"]
    run.ticks(2)
    assert run.statuses() == {"held"}


def test_forces_too_large_to_add_up_are_refused_and_the_robot_holds(run: Stage) -> None:
    run.model.collision[:] = 1e308
    run.play(lambda: run.statuses() == {"held"}, "the hold", ticks=10)
    assert run.rig.stat("controller").rejected["value"] >= 3
    run.model.collision[:] = 0.0
    run.under_control()


def test_forces_from_the_future_are_no_forces(run: Stage) -> None:
    run.model.silent = True
    run.model.put(run.rig.bus.k + 1000)
    run.play(lambda: run.statuses() == {"held"}, "the hold", ticks=10)


# Actions


def test_an_action_moves_and_settles_at_its_goal(run: Stage) -> None:
    run.model.touched = {"left_arm": ["table"]}
    _, epoch = run.own("left_arm")
    started = run.goal("left_arm", epoch, near("left_arm"), "go")
    assert started.k == run.rig.bus.k
    run.tick()
    moving = run.motion("left_arm")
    assert (moving.status, moving.action_id, moving.epoch, moving.start_k) == ("moving", "go", epoch, started.k)
    run.play(lambda: run.motion("left_arm").status != "moving", "the end")
    done = run.motion("left_arm")
    assert (done.status, done.action_id, done.touched) == ("settled", "go", ["table"])
    assert (done.since_k - done.start_k) * 0.01 >= SETTLE.first_look
    np.testing.assert_allclose(done.goal, near("left_arm"), atol=1e-15)
    moves = Gains.published_2014().weight(ROBOT.part("left_arm").motors) > 0  # the published gains leave the fingers alone
    np.testing.assert_allclose(np.array(done.q)[moves], near("left_arm")[moves], atol=0.05)
    assert np.abs(np.array(done.q) - ROBOT.home[ROBOT.part("left_arm").slice]).max() > 0.2
    assert {run.motion(p).status for p in ("torso", "right_arm")} == {"idle"}
    run.ticks(5)
    assert run.motion("left_arm").since_k == done.since_k


def test_an_action_that_does_not_die_down_times_out(run: Stage) -> None:
    _, epoch = run.own("torso")
    run.sim.frozen = True  # the spring pulls for ever, so the commanded velocity stays
    run.goal("torso", epoch, near("torso", 0.5), "in_vain")
    for _ in range(60):
        if run.motion("torso").status == "timeout":
            break
        run.tick(skip=49)
    motion = run.motion("torso")
    assert (motion.status, motion.action_id) == ("timeout", "in_vain")
    assert (motion.since_k - motion.start_k) * 0.01 == pytest.approx(SETTLE.timeout, abs=0.5)


def test_a_second_goal_replaces_the_first(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm"), "one")
    run.ticks(5)
    run.goal("left_arm", epoch, near("left_arm", -0.2), "two")
    run.tick()
    motion = run.motion("left_arm")
    assert (motion.action_id, motion.status) == ("two", "moving")
    np.testing.assert_allclose(motion.goal, near("left_arm", -0.2), atol=1e-15)


# Ownership of goals


def test_a_goal_belongs_to_one_owner_while_its_token_is_there(run: Stage) -> None:
    first, epoch = run.own("left_arm", "agent_left_arm")
    assert "agent_left_arm" in refused("owned", lambda: run.own("left_arm", "agent_rival"))
    run.own("right_arm", "agent_rival")  # another part is free
    newer = run.take("left_arm", first, "agent_left_arm")
    assert newer is not None
    assert newer > epoch
    refused("epoch", lambda: run.goal("left_arm", epoch, near("left_arm")))
    run.goal("left_arm", newer, near("left_arm"))
    run.leave("agent_left_arm", first)
    _, rival = wait_for(lambda: _try(lambda: run.own("left_arm", "agent_rival")), "the goal to be free")
    assert rival > newer
    refused("epoch", lambda: run.goal("left_arm", newer, near("left_arm")))


def _try(call: Callable[[], Any]) -> Any:
    try:
        return call()
    except CallFailed:
        return None


def test_nobody_takes_a_goal_without_a_token(run: Stage) -> None:
    refused("token", lambda: run.rig.call(keys.goal("torso", "take"), Take, Taken, who="ghost", instance="n0"))


def test_a_released_goal_is_free_and_its_part_stays(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm"))
    run.ticks(20)
    run.rig.call(keys.goal("left_arm", "release"), WithEpoch, Done, epoch=epoch)
    refused("epoch", lambda: run.goal("left_arm", epoch, near("left_arm")))
    run.tick()
    assert (run.motion("left_arm").status, run.motion("left_arm").epoch) == ("idle", 0)
    run.own("left_arm", "agent_next")


def test_a_goal_outside_the_limits_is_refused_with_motor_and_range(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.tick()
    before = run.motion("left_arm").goal
    q = near("left_arm")
    q[3] = ROBOT.limits[ROBOT.part("left_arm").slice][3, 1] + 0.01
    text = refused("limits", lambda: run.goal("left_arm", epoch, q))
    assert "l_elbow" in text
    assert f"to {q[3] - 0.01:.4f}" in text
    refused("length", lambda: run.goal("left_arm", epoch, q[:3]))
    refused("value", lambda: run.goal("left_arm", epoch, np.full(16, np.nan)))
    run.tick()
    assert (run.motion("left_arm").goal, run.motion("left_arm").status) == (before, "idle")


def test_when_an_agent_dies_its_part_stays_and_the_others_go_on(run: Stage) -> None:
    who, other = "agent_left_arm", "agent_right_arm"
    dying, epoch = run.own("left_arm", who)
    _, living = run.own("right_arm", other)
    run.goal("left_arm", epoch, near("left_arm", 0.8), "dying")
    run.goal("right_arm", living, near("right_arm"), "living")
    run.ticks(30)
    assert np.abs(run.motion("left_arm").dq).max() > 0.1
    run.leave(who, dying)
    run.play(lambda: run.motion("left_arm").status == "idle", "the part to stay", ticks=1000)
    there = np.array(run.motion("left_arm").goal)
    assert np.abs(there - run.sim.of("left_arm")).max() < 0.05  # where it was measured
    assert run.motion("left_arm").epoch == 0
    run.play(lambda: run.motion("right_arm").status == "settled", "the other action")
    np.testing.assert_allclose(run.motion("left_arm").goal, there, atol=1e-15)
    assert run.motion("right_arm").action_id == "living"


def test_the_head_goes_to_its_posture(run: Stage) -> None:
    np.testing.assert_allclose(run.motion("head").goal, HEAD, atol=1e-15)
    run.play(lambda: abs(run.sim.of("head")[0] - HEAD[0]) < 0.02, "the head")
    assert abs(run.sim.of("head")[2] - HEAD[2]) < 0.02


# Forces of clients


def test_a_push_at_a_marker_moves_the_arm_until_it_is_cleared(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    _, other = run.own("right_arm", "agent_right_arm")
    where = Model(ROBOT).evaluate(run.sim.q).position("left_palm")
    run.force("left_arm", epoch, marker="left_palm", push=[0.0, 0.0, 30.0])
    run.force("right_arm", other, f=[1.0] + [0.0] * 15)
    run.ticks(60)
    moved = Model(ROBOT).evaluate(run.sim.q).position("left_palm") - where
    assert moved[2] > 0.005
    assert run.motion("right_arm").dq[0] > 1e-4
    run.force("left_arm", epoch)
    far = np.abs(run.sim.q - run.rig.robot.home)
    run.ticks(150)
    left, right = (ROBOT.part(part).start for part in ("left_arm", "right_arm"))
    now = np.abs(run.sim.q - run.rig.robot.home)
    assert now[left] < 0.5 * far[left]  # back to the attractor
    assert now[right] > far[right] > 0.002  # the other part's force goes on


def test_a_wrong_force_is_refused(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    assert "left_palm" in refused("force", lambda: run.force("left_arm", epoch, marker="left_plam", push=[0.0, 0.0, 1.0]))
    refused("force", lambda: run.force("left_arm", epoch, marker="left_palm"))
    refused("force", lambda: run.force("left_arm", epoch, push=[0.0, 0.0, 1.0]))
    assert "does not move" in refused("force", lambda: run.force("left_arm", epoch, marker="right_palm", push=[0.0, 0.0, 1.0]))
    refused("length", lambda: run.force("left_arm", epoch, f=[1.0]))
    refused("epoch", lambda: run.force("left_arm", epoch - 1, f=[0.0] * 16))


def test_forces_of_any_size_leave_the_law_with_numbers(run: Stage) -> None:
    owned = {part: run.own(part, f"agent_{part}")[1] for part in ("torso", "left_arm")}
    for part, epoch in owned.items():
        refused("force", lambda part=part, epoch=epoch: run.force(part, epoch, marker="left_palm", push=[1.7e308, 0.0, 0.0]))
        refused("force", lambda part=part, epoch=epoch: run.force(part, epoch, f=[-1e300] * len(ROBOT.part(part))))
        run.force(part, epoch, marker="left_palm", push=[1e8, -1e8, 1e8])
        run.force(part, epoch, f=[-1e8] * len(ROBOT.part(part)))
    run.ticks(20)
    assert run.statuses() == {"idle"}
    assert 0.01 < np.abs([*run.motion("torso").dq, *run.motion("left_arm").dq]).max() <= 1.1


def test_forces_end_with_a_hold_and_with_their_owner(run: Stage) -> None:
    instance, epoch = run.own("left_arm")
    for end in (lambda: run.sim.hold("left_arm"), lambda: run.leave("agent_test", instance)):
        run.force("left_arm", epoch, f=[5.0] + [0.0] * 15)
        run.play(lambda: run.motion("left_arm").dq[0] > 0.02, "the push", ticks=100)
        end()
        run.ticks(60)
        run.play(lambda: run.motion("left_arm").status == "idle", "its return")
        assert abs(run.motion("left_arm").dq[0]) < 0.01


# What holds when


def test_between_an_emergency_stop_and_its_reset_nothing_is_armed(run: Stage) -> None:
    """Also not by a robot_sim that died under the stop and has come back without knowing of it."""

    def tell(stop: bool) -> None:
        header = {"v": VERSION, "run": "another", "src": "test", "seq": 0, "k": 0, "t": 0, "tw": 0}
        message = EStop(**header, set=stop, source="test", reason="test")  # type: ignore[arg-type]
        run.rig.session.put(keys.ESTOP, encode(message), encoding=encoding_of(EStop))

    run.ticks(30)
    tell(True)
    run.ticks(30)
    run.sim.new_run()
    epochs = {part: gate.epoch for part, gate in run.sim.gates.items()}
    run.ticks(100)
    assert {part: gate.epoch for part, gate in run.sim.gates.items()} == epochs
    assert {run.motion(part).status for part in ROBOT.parts} == {"held"}
    tell(False)
    run.play(lambda: all(run.motion(part).status == "idle" for part in ROBOT.parts), "all parts to be armed", ticks=1000)


def test_a_part_that_the_gate_drops_is_held_and_armed_again_at_rest(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm", 0.8), "dropped")
    run.ticks(30)
    before = run.sim.gates["left_arm"].epoch
    run.sim.refuses_to_arm = {"left_arm"}
    run.sim.hold("left_arm")
    run.play(lambda: run.motion("left_arm").status == "held", "the hold", ticks=50)
    assert run.motion("left_arm").action_id == "dropped"
    refused("held", lambda: run.goal("left_arm", epoch, near("left_arm")))
    assert {run.motion(p).status for p in ("torso", "right_arm")} == {"idle"}
    run.sim.refuses_to_arm = set()
    run.play(lambda: run.motion("left_arm").status == "idle", "the part to come back", ticks=1000)
    motion = run.motion("left_arm")
    gate = run.sim.gates["left_arm"]
    first = wait_for(lambda: [c for c in run.commands("left_arm") if c.epoch == gate.epoch], "its first command")[0]
    assert gate.epoch > before
    np.testing.assert_allclose(first.ref, 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.goal, run.sim.of("left_arm"), atol=0.01)
    assert motion.action_id == ""
    assert run.numbers()["held_ticks"] > 0
    run.goal("left_arm", epoch, near("left_arm"), "after")  # the goal's owner is still the same
    run.play(lambda: run.motion("left_arm").status == "settled", "the next action")


def test_while_one_part_waits_to_be_armed_the_others_get_their_commands(run: Stage) -> None:
    takes = len(run.sim.takes)
    run.sim.answers.clear()
    try:
        run.sim.hold("left_arm")
        since = run.rig.bus.k
        run.ticks(20)
        assert len(wait_for(lambda: len(run.commands("torso", since)) == 20 and run.commands("torso", since), "commands")) == 20
        assert run.motion("left_arm").status == "held"
    finally:
        run.sim.answers.set()
    run.play(lambda: run.motion("left_arm").status == "idle", "its return")
    assert len(run.sim.takes) - takes < 10  # a controller that waits for each answer asks anew every tick


def test_a_part_whose_state_stands_still_is_not_under_control(run: Stage) -> None:
    events = run.rig.record(keys.event("controller"), Event)
    run.sim.silent = {"right_arm"}
    run.play(lambda: run.motion("right_arm").status == "held", "the hold", ticks=30)
    assert run.motion("torso").status == "idle"
    since = run.rig.bus.k
    run.ticks(5)
    assert run.commands("right_arm", since) == []
    wait_for(lambda: any("no fresh state" in e.text for e in events if e.code == "held"), "the event")


def test_a_new_run_resets_everything_but_who_owns_the_goals(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.force("left_arm", epoch, f=[5.0] + [0.0] * 15)
    run.goal("left_arm", epoch, near("left_arm", 0.8), "old")
    run.ticks(40)
    takes = len(run.sim.takes)
    run.sim.new_run()
    assert run.rig.bus.k == 0
    run.under_control()
    motion = run.motion("left_arm")
    assert sorted(run.sim.takes[takes:]) == sorted(PARTS)
    assert (motion.action_id, motion.epoch) == ("", epoch)
    np.testing.assert_allclose(motion.goal, ROBOT.home[ROBOT.part("left_arm").slice], atol=1e-9)
    run.ticks(20)
    assert np.abs(run.motion("left_arm").dq).max() < 1e-6  # neither the old goal nor the old force
    run.goal("left_arm", epoch, near("left_arm"), "new")


def test_a_paused_and_a_much_too_slow_clock_are_not_answered(run: Stage) -> None:
    k = run.rig.bus.k
    counts = {part: len(run.motions[part]) for part in PARTS}
    run.sim.tick(mode="paused")
    run.sim.tick(dt_ns=50_000_000)
    wait_for(lambda: run.rig.stat("controller").rejected.get("rate") == 1, "the refusal")
    assert {part: len(run.motions[part]) for part in PARTS} == counts
    assert run.tick() == k + 3


def test_random_bytes_on_every_key_move_nothing(run: Stage, rng: np.random.Generator) -> None:
    run.play(lambda: np.abs(run.motion("head").dq).max() < 1e-3, "the head to rest")
    before = run.sim.q.copy()
    targets = [(keys.TICK, Tick), (keys.MODEL_FORCES, Forces), (keys.goal("torso", "goal"), Goal)]
    for n in range(300):
        key, cls = targets[n % 3]
        payload = rng.bytes(int(rng.integers(0, 300)))
        if cls is Goal:
            assert [a.ok for a in run.rig.session.get(key, payload=payload, encoding=encoding_of(cls), timeout=2.0)] == [None]
        else:
            run.rig.session.put(key, payload, encoding=encoding_of(cls))
        if n % 30 == 0:
            run.sim.tick()  # which may be overtaken by bytes on the same key: then it is a lost tick
    run.rig.session.put(keys.TICK, b"the last", encoding=encoding_of(Goal))
    wait_for(lambda: run.rig.stat("controller").rejected.get("type") == 1, "the last refusal")
    assert run.rig.stat("controller").rejected["decode"] >= 75
    run.ticks(10)
    np.testing.assert_allclose(run.sim.q[:3], before[:3], atol=1e-6)
    np.testing.assert_allclose(run.sim.q, before, atol=0.01)


def test_absurd_states_do_not_end_the_controller_and_are_forgotten(run: Stage) -> None:
    right = run.sim.q.copy()
    run.sim.q = np.full(41, 1e300)
    run.sim.frozen = True
    run.ticks(2)
    run.sim.q, run.sim.frozen = right, False
    run.play(lambda: np.abs(run.motion("torso").dq).max() < 1e-3, "rest", ticks=500)
    assert run.statuses() == {"idle"}


# Processes


def test_a_controller_that_was_killed_is_replaced_by_one_that_takes_all_anew(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as made:
        first = staged(made)
        first.under_control()
        _, epoch = first.own("left_arm")
        gates = {part: gate.epoch for part, gate in first.sim.gates.items()}
        assert first.controller.stop(signal.SIGKILL) == -signal.SIGKILL
        for part in PARTS:  # as the gate does when the owner's token is gone
            first.sim.hold(part)
        first.controller = made.start("services.controller", "controller")
        k = made.bus.k
        first.play(lambda: first.statuses() == {"idle"} and first.motion("torso").k > k, "control again")
        assert all(gate.epoch > gates[part] for part, gate in first.sim.gates.items())
        refused("epoch", lambda: first.goal("left_arm", epoch, near("left_arm")))
        _, newer = first.own("left_arm", "agent_next")
        assert newer > epoch
        assert first.controller.stop() == 0


def test_position_commands_begin_at_the_measured_posture(tmp_path: Path) -> None:
    with rig(tmp_path, ROBOT) as made:
        stage = staged(made, "--modality", "position", "--gains", "default")
        stage.sim.q = ROBOT.home + 0.2 * (ROBOT.limits.mean(axis=1) - ROBOT.home)
        stage.sim.frozen = True
        stage.under_control()
        first = wait_for(lambda: stage.commands("right_arm"), "a command")[0]
        assert first.mode == "position"
        np.testing.assert_allclose(first.ref, stage.sim.of("right_arm"), atol=1e-3)


@pytest.mark.parametrize(
    ("posture", "says"),
    [
        ("head = [0.0]", "it has 6 motors"),
        ("heat = [0.0]", "Did you mean 'head'?"),
        ("head = [9.0, 0.0, 0.0, 0.0, 0.0, 0.0]", "neck_pitch at 9 rad, its range is"),
    ],
)
def test_a_posture_that_the_robot_cannot_take_is_told_in_one_line(stage: Stage, tmp_path: Path, posture: str, says: str) -> None:
    settings = tmp_path / "controller.toml"
    settings.write_text(f"[posture]\n{posture}\n")
    program = stage.rig.spawn("-m", "services.controller", "--endpoint", stage.rig.endpoint, "--config", str(settings))
    assert program.wait(20.0) == 2
    assert says in program.says
    assert "Traceback" not in program.says
