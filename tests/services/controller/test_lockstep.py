# SPDX-License-Identifier: Apache-2.0
"""The controller in lockstep: the test plays robot_sim and the model, tick by tick."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from bus_schema.messages import Motion, StepDone
from mobee.control import Settle
from services.controller.action import Action, Owner, busy_owners
from tests.services.controller.stage import PARTS, ROBOT, Stage, near, staged
from tests.services.harness import Rig, rig, wait_for

SILENCE = 0.3  # s in which something would have happened


@dataclass
class Answered:
    """What the controller said to a tick, along with its commands or by itself."""

    re_k: int
    ok: bool
    busy: list[str]


@dataclass
class Bench:
    stage: Stage
    alone: list[StepDone]

    @property
    def answers(self) -> list[Answered]:
        along = [Answered(k, answer.ok, answer.busy) for k, answer in self.stage.sim.answers_along]
        return sorted([*along, *(Answered(done.re_k, done.ok, done.busy) for done in self.alone)], key=lambda answer: answer.re_k)

    def tick(self) -> Answered:
        k = self.stage.sim.tick(mode="lock")
        return self.answer(k)

    def answer(self, k: int) -> Answered:
        return wait_for(lambda: next((done for done in self.answers if done.re_k == k), None), f"the answer to tick {k}")


def begun(made: Rig) -> Bench:
    """The controller has answered tick 0."""
    answers = made.record(StepDone, "controller")
    bench = Bench(staged(made, "--mode", "lock"), answers)
    made.token("model", "m1")

    def ask() -> bool:
        bus = made.bus
        bus.k, bus.t = -1, -bench.stage.sim.dt_ns
        bus.k, bus.t = 0, 0
        bench.stage.sim.sample()
        bench.stage.sim.begin("lock")
        time.sleep(0.02)
        return bool(answers)

    wait_for(ask, "the answer to tick 0")
    return bench


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with rig(tmp_path_factory.mktemp("controller"), ROBOT) as made:
        yield begun(made)


@pytest.fixture
def bench(started: Bench) -> Iterator[Bench]:
    """All parts are under control, and no goal has an owner."""
    started.stage.model.silent = False
    while started.stage.statuses() != {"idle"} or not started.answers[-1].ok:
        started.tick()
        time.sleep(0.01)  # motion comes on a thread of its own
    yield started
    for who, instance in list(started.stage.owned):
        started.stage.leave(who, instance)


def test_it_answers_tick_0_when_all_is_armed_and_has_not_moved(started: Bench) -> None:
    assert {gate.state for gate in started.stage.sim.gates.values()} == {"armed"}
    assert all(not started.stage.commands(part, since=-1) for part in PARTS)
    assert (started.answers[-1].re_k, started.answers[-1].ok) == (0, True)


def test_its_answer_comes_after_its_commands_and_names_the_busy_services(bench: Bench) -> None:
    _, epoch = bench.stage.own("torso", "agent_torso")
    bench.stage.goal("torso", epoch, near("torso"))
    assert bench.answers[-1].busy == []
    done = bench.tick()
    assert done.busy == ["agent_torso"]
    wait_for(lambda: all(bench.stage.commands(part, since=done.re_k - 1) for part in PARTS), "the commands")


def test_its_answer_travels_with_its_commands_and_includes_the_models(bench: Bench) -> None:
    before = len(bench.alone)
    k = bench.tick().re_k
    assert len(bench.alone) == before
    newest, answer = bench.stage.sim.answers_along[-1]
    assert (newest, answer.including) == (k, ["test"])  # the rig's name, which here is the model's


def test_it_waits_for_the_forces_of_the_tick_however_long(bench: Bench) -> None:
    bench.tick()
    bench.stage.model.silent = True
    k = bench.stage.sim.tick(mode="lock")
    time.sleep(SILENCE)
    assert bench.answers[-1].re_k == k - 1
    bench.stage.model.put(k)
    assert bench.answer(k).ok


def test_without_a_model_it_lets_all_hold_and_says_so(bench: Bench) -> None:
    bench.tick()
    bench.stage.model.silent = True
    k = bench.stage.sim.tick(mode="lock")
    bench.stage.rig.drop_token("model", "m1")
    assert not bench.answer(k).ok
    wait_for(lambda: all(bench.stage.commands(part, since=k - 1) for part in PARTS), "the commands")
    assert {bench.stage.commands(part)[-1].mode for part in PARTS} == {"hold"}
    bench.stage.rig.token("model", "m1")


def test_it_does_not_answer_while_a_part_is_being_armed(bench: Bench) -> None:
    bench.tick()
    bench.stage.sim.answers.clear()
    bench.stage.sim.hold("torso")
    k = bench.stage.sim.tick(mode="lock")
    time.sleep(SILENCE)
    assert bench.answers[-1].re_k == k - 1
    bench.stage.sim.answers.set()
    bench.answer(k)
    assert bench.stage.sim.gates["torso"].state == "armed"


def test_a_moving_part_is_published_at_intervals_and_its_end_at_once(bench: Bench) -> None:
    _, epoch = bench.stage.own("torso", "agent_torso")
    bench.stage.goal("torso", epoch, ROBOT.home[ROBOT.part("torso").slice])
    reported: list[Motion] = bench.stage.motions["torso"]
    first = bench.answers[-1].re_k
    while "agent_torso" in (done := bench.tick()).busy:
        pass
    wait_for(lambda: reported[-1].status == "settled" and reported[-1].k == done.re_k, "its end")
    under_way = [motion.k for motion in reported if motion.status == "moving" and motion.k > first]
    assert under_way[0] == first + 1
    assert all(k % 10 == 0 for k in under_way[1:])


def test_an_owner_is_busy_when_all_its_parts_are() -> None:
    settle = Settle(speed=0.1, acceleration=0.1)

    def action(status: str, who: str = "") -> Action:
        made = Action(settle)
        made.status = status
        made.owner = Owner(who, "i1", 1) if who else None
        return made

    assert busy_owners([action("moving", "a"), action("moving", "a"), action("moving")]) == ["a"]
    assert busy_owners([action("moving", "a"), action("settled", "a"), action("moving", "b")]) == ["b"]
