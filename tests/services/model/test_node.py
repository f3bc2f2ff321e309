# SPDX-License-Identifier: Apache-2.0
"""The model answers every tick with forces, poses and contacts, and calls with Jacobians."""

from __future__ import annotations

import numpy as np
import pytest

from bus_schema import encoding_of, keys
from bus_schema.messages import Clock, Tick, WorldObject
from bus_schema.rpc import (
    AddObject,
    Done,
    Empty,
    JacobianAt,
    JacobianReply,
)
from mobee import Gains, constraint_forces
from mobee.control.forces import published_terms
from mobee.model.kinematics import matrix_from_quaternion
from services.common.rpc import CallFailed
from tests.services.harness import wait_for
from tests.services.model.stage import TICK, Stage, library, on_the_table


def test_forces_answer_every_tick_and_equal_the_librarys(run: Stage, rng: np.random.Generator) -> None:
    model, gains = library(), Gains.published_2014()
    low, high = run.rig.robot.limits.T
    for _ in range(5):
        q = rng.uniform(low, high)
        answer = run.at(q)
        expected = constraint_forces(model.evaluate(q), gains, "tree")
        assert answer.re_k == answer.k == run.rig.bus.k
        assert tuple(answer.terms) == published_terms()
        for name, force in answer.terms.items():
            np.testing.assert_allclose(force, expected[name], atol=1e-12)


def test_the_table_causes_contacts_and_pushes_the_arm_off(run: Stage) -> None:
    q = on_the_table()
    answer = run.at(q)
    model = library()
    f = np.array(answer.terms["collision"])
    assert np.abs(f).max() > 0.1
    assert answer.touched["left_arm"] == ["table"]
    contacts = [c for c in model.evaluate(q).contacts if c.second == "table"]
    depth = sum(c.depth for c in contacts)
    moved = sum(c.depth for c in model.evaluate(q + 1e-3 * f / np.abs(f).max()).contacts if c.second == "table")
    assert moved < depth
    said = [(c.first, c.second, c.kind) for c in run.contacts[-1].contacts]
    assert said == [(c.first, c.second, c.kind) for c in model.evaluate(q).contacts]


def test_markers_are_where_the_library_has_them(run: Stage, rng: np.random.Generator) -> None:
    q = rng.uniform(*run.rig.robot.limits.T)
    run.at(q)  # comes back with the forces, and the pose is said after them
    wait_for(lambda: run.poses and np.allclose(run.poses[-1].q, q, atol=1e-15), "the pose")
    said, pose = run.poses[-1], library().evaluate(q)
    np.testing.assert_allclose(said.q, q, atol=1e-15)
    assert {m.name for m in said.markers} == set(run.rig.robot.markers)
    for marker in said.markers:
        np.testing.assert_allclose(marker.position, pose.position(marker.name), atol=1e-12)
        np.testing.assert_allclose(matrix_from_quaternion(np.array(marker.quaternion)), pose.rotation(marker.name), atol=1e-9)


def test_nothing_is_published_before_every_part_has_reported(run: Stage) -> None:
    run.sim.new_run()
    run.sim.silent = {"head"}
    before = len(run.forces)
    for _ in range(3):
        run.sim.tick()
    wait_for(lambda: run.rig.stat("model").ready, "an answer")  # the ticks have been handled by now
    assert len(run.forces) == before
    run.sim.silent = set()
    run.tick()


def test_the_age_of_each_part_is_published_and_grows_while_it_is_silent(run: Stage) -> None:
    fresh = run.tick().part_age
    assert fresh == dict.fromkeys(run.rig.robot.parts, TICK // 2)
    run.sim.silent = {"torso"}
    run.sim.q = run.sim.q + 0.01
    for n in range(1, 4):
        answer = run.tick()
        assert answer.part_age["torso"] == TICK // 2 + n * TICK
        assert answer.part_age["left_arm"] == TICK // 2
    torso = run.rig.robot.part("torso").slice
    assert np.ptp(np.array(run.poses[-1].q)[torso] - run.rig.robot.home[torso]) == 0.0


def test_skipped_ticks_are_counted(run: Stage) -> None:
    run.rig.call(keys.service_rpc("model", "mark"), Empty, Done)
    run.tick()
    run.tick(skip=4)
    assert (run.numbers()["ticks"], run.numbers()["skipped"]) == (2, 4)


def test_ticks_on_the_table_are_counted(run: Stage) -> None:
    run.rig.call(keys.service_rpc("model", "mark"), Empty, Done)
    run.at(on_the_table())
    run.tick()
    run.at(run.rig.robot.home)
    numbers = run.numbers()
    assert numbers["table_ticks"] == 2
    assert numbers["field_ticks"] >= 2
    assert numbers["evaluate_ms_p50"] > 0


def test_a_new_run_removes_perceived_objects(run: Stage) -> None:
    run.perceive([-0.3, 0.0, 0.1], valid_for=10_000)
    wait_for(lambda: "ball" in run.world(), "the ball")
    run.sim.new_run()
    assert run.tick().run == run.rig.bus.run
    assert "ball" not in run.world()


def test_a_tick_without_some_part_is_refused(run: Stage) -> None:
    before = len(run.forces)
    del run.sim.statuses["torso"]
    run.sim.begin(whole=False)
    wait_for(lambda: run.rig.stat("model").rejected.get("part"), "the refusal")
    assert len(run.forces) == before
    assert run.tick().run == run.rig.bus.run


def test_jacobians_on_request_are_the_librarys(run: Stage, rng: np.random.Generator) -> None:
    q = rng.uniform(*run.rig.robot.limits.T)
    run.at(q)
    model = library()
    for where, asked in ((q, None), (run.rig.robot.home, run.rig.robot.home.tolist())):
        reply = run.rig.call(keys.MODEL_JACOBIAN, JacobianAt, JacobianReply, marker="right_palm", q=asked)
        got = np.array(reply.data).reshape(reply.rows, reply.columns)
        np.testing.assert_allclose(got, model.jacobian(where, "right_palm"), atol=1e-12)
    with pytest.raises(CallFailed, match="Did you mean 'right_palm'?"):
        run.rig.call(keys.MODEL_JACOBIAN, JacobianAt, JacobianReply, marker="right_plam")
    with pytest.raises(CallFailed) as caught:
        run.rig.call(keys.MODEL_JACOBIAN, JacobianAt, JacobianReply, marker="right_palm", q=[0.0])
    assert caught.value.code == "length"


def test_random_bytes_and_absurd_numbers_harm_nothing(run: Stage, rng: np.random.Generator) -> None:
    targets = [Clock.stream.key(), Tick.stream.key(), WorldObject.stream.key("ball"), keys.world_rpc("add"), keys.MODEL_JACOBIAN]
    types = [Clock, Tick, WorldObject, AddObject, JacobianAt]
    for _ in range(300):
        at = int(rng.integers(len(targets)))
        payload = rng.bytes(int(rng.integers(0, 300)))
        if "/rpc/" in targets[at]:
            answers = run.rig.session.get(targets[at], payload=payload, encoding=encoding_of(types[at]), timeout=2.0)
            assert [a.ok for a in answers] == [None]
        else:
            run.rig.session.put(targets[at], payload, encoding=encoding_of(types[at]))
    for absurd in (1e10, 1e300):
        run.sim.q = np.full(41, absurd)
        run.sim.tick()
    wait_for(lambda: run.rig.stat("model").rejected.get("decode", 0) > 0, "the refusals")
    assert run.at(run.rig.robot.home).re_k == run.rig.bus.k
    assert run.model.is_running
