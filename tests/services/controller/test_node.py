# SPDX-License-Identifier: Apache-2.0
"""The controller answers every tick with commands to all parts, or holds."""

from __future__ import annotations

import time

import numpy as np

from bus_schema import encoding_of, keys
from bus_schema.messages import Forces, Tick
from bus_schema.rpc import Goal
from mobee import Controller, Gains, Model
from mobee.control import Forces as Acting
from tests.services.controller.stage import PARTS, ROBOT, Stage, near, refused
from tests.services.harness import wait_for


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


def test_without_forces_for_longer_than_three_ticks_the_robot_holds_and_the_action_continues_when_they_are_back(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm"), "interrupted")
    run.ticks(10)
    run.model.silent = True
    run.ticks(3)
    assert run.motion("left_arm").status == "moving"
    k = run.tick()
    found = {p: (run.motion(p).status, run.motion(p).since_k) for p in PARTS}
    assert found == dict.fromkeys(PARTS, ("held", k)) | {"left_arm": ("suspended", k)}
    assert run.motion("left_arm").action_id == "interrupted"
    for part in PARTS:
        assert wait_for(lambda part=part: run.commands(part, k - 1), "the command")[-1].mode == "hold"
    refused("held", lambda: run.goal("left_arm", epoch, near("left_arm")))
    refused("held", lambda: run.force("left_arm", epoch, f=[1.0] * 16))
    run.force("left_arm", epoch)  # clearing is always right
    run.ticks(150)  # longer than any interval of the settle test
    assert run.statuses() == {"held", "suspended"}
    assert "settled" not in {m.status for m in run.motions["left_arm"] if m.action_id == "interrupted"}
    run.model.silent = False
    k = run.tick()
    motion, other = run.motion("left_arm"), run.motion("right_arm")
    assert (motion.status, motion.action_id, motion.since_k) == ("moving", "interrupted", k)
    assert (other.status, other.action_id) == ("idle", "")
    np.testing.assert_allclose(motion.goal, near("left_arm"), atol=1e-12)
    command = wait_for(lambda: run.commands("left_arm", k - 1), "the command")[-1]
    assert 0.0 < np.abs(command.ref).max() < 0.1  # rad/s, from rest
    motion = run.play(lambda: (m := run.motion("left_arm")).status == "settled" and m, "the end of the action")
    assert motion.action_id == "interrupted"
    np.testing.assert_allclose(motion.q[:7], near("left_arm")[:7], atol=np.deg2rad(2.0))


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
    targets = [(Tick.stream.key(), Tick), (Forces.stream.key("model"), Forces), (keys.goal("torso", "goal"), Goal)]
    for n in range(300):
        key, cls = targets[n % 3]
        payload = rng.bytes(int(rng.integers(0, 300)))
        if cls is Goal:
            assert [a.ok for a in run.rig.session.get(key, payload=payload, encoding=encoding_of(cls), timeout=2.0)] == [None]
        else:
            run.rig.session.put(key, payload, encoding=encoding_of(cls))
        if n % 30 == 0:
            run.sim.tick()  # which may be overtaken by bytes on the same key: then it is a lost tick
    run.rig.session.put(Tick.stream.key(), b"the last", encoding=encoding_of(Goal))
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
