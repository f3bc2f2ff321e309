"""The model as a process: the test plays robot_sim, vision and whoever edits the world."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from bus_schema import encoding_of, keys
from bus_schema.chain import Tick
from bus_schema.messages import Clock, Contacts, Event, Forces, Geometry, Pose, WorldObject
from bus_schema.rpc import (
    AddObject,
    Attach,
    Done,
    Empty,
    JacobianAt,
    JacobianReply,
    MoveObject,
    ObjectState,
    OneName,
    SetRole,
    World,
)
from mobee import Gains, Model, constraint_forces, load_robot, load_world
from mobee.kinematics.quaternion import to_matrix
from mobee.robot.robot import Array
from services.common.delivery import DATA
from services.common.rpc import CallFailed
from tests.services.harness import FakeSim, Program, Rig, rig, wait_for

TICK = 10_000_000  # ns
BALL = Geometry(kind="sphere", size=[0.03])
UPRIGHT = [1.0, 0.0, 0.0, 0.0]


@dataclass
class Stage:
    """The model under test and what it says."""

    rig: Rig
    sim: FakeSim
    model: Program
    forces: list[Forces]
    poses: list[Pose]
    contacts: list[Contacts]

    def tick(self, **how: Any) -> Forces:
        """One tick of the simulator, and the model's whole answer to it."""
        k = self.sim.tick(**how)
        wait_for(lambda: self.contacts and self.contacts[-1].re_k == k and self.contacts[-1].run == self.rig.bus.run, f"contacts {k}")
        wait_for(lambda: self.forces[-1].re_k == k, f"forces {k}")
        return self.forces[-1]

    def at(self, q: Array) -> Forces:
        self.sim.q = q.copy()
        return self.tick()

    def edit(self, verb: str, request: type[Any], **fields: Any) -> None:
        self.rig.call(keys.world_rpc(verb), request, Done, **fields)

    def world(self) -> dict[str, ObjectState]:
        return {o.name: o for o in self.rig.call(keys.world_rpc("list"), Empty, World).objects}

    def numbers(self) -> dict[str, float]:
        return self.rig.stat("model").numbers

    def perceive(self, position: list[float], valid_for: int = 50, **fields: Any) -> None:
        """As vision does; `valid_for` ticks."""
        t = self.rig.bus.t
        whole = {"name": "ball", "geometry": BALL, "quaternion": UPRIGHT, "role": "target", **fields}
        publisher = self.rig.bus.publisher(keys.world("ball"), WorldObject, DATA)
        publisher.put(position=position, covariance=[0.0] * 9, t_capture=t, valid_until=t + valid_for * TICK, **whole)


def staged(made: Rig, *arguments: str) -> Stage:
    sim = FakeSim(made)
    streams = (made.record(keys.MODEL_FORCES, Forces), made.record(keys.MODEL_POSE, Pose), made.record(keys.MODEL_CONTACTS, Contacts))
    return Stage(made, sim, made.start("services.model", "model", *arguments), *streams)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stage]:
    with rig(tmp_path_factory.mktemp("model"), load_robot("icub")) as made:
        yield staged(made)


@pytest.fixture
def run(stage: Stage) -> Stage:
    """The stage in a new run, at home."""
    stage.sim.new_run()
    stage.sim.silent = set()
    stage.tick()
    return stage


def library() -> Model:
    """What the model service should know: the table's world without what is left to be perceived."""
    world = load_world("table")
    for name in [name for name, thing in world.objects.items() if thing.role == "target"]:
        world.remove(name)
    return Model(load_robot("icub"), world)


def on_the_table() -> Array:
    """A pose whose left arm pushes into the table's field, found with the library."""
    model, rng = library(), np.random.default_rng(5)
    robot = model.robot
    where = robot.part("left_arm").slice
    for _ in range(2000):
        q = robot.home.copy()
        q[where] = rng.uniform(*robot.limits[where].T)
        if any(c.second == "table" for c in model.evaluate(q).contacts):
            return q
    raise AssertionError("no such pose")


# Assembly and forces


def test_forces_answer_every_tick_and_equal_the_librarys(run: Stage, rng: np.random.Generator) -> None:
    model, gains = library(), Gains.published_2014()
    low, high = run.rig.robot.limits.T
    for _ in range(5):
        q = rng.uniform(low, high)
        answer = run.at(q)
        expected = constraint_forces(model.evaluate(q), gains, "tree")
        assert answer.re_k == answer.k == run.rig.bus.k
        np.testing.assert_allclose(answer.limits, expected.limits, atol=1e-12)
        np.testing.assert_allclose(answer.constraints, expected.constraints, atol=1e-12)
        np.testing.assert_allclose(answer.collision, expected.collision, atol=1e-12)


def test_the_table_is_felt_and_pushes_the_arm_off(run: Stage) -> None:
    q = on_the_table()
    answer = run.at(q)
    model = library()
    f = np.array(answer.collision)
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
        np.testing.assert_allclose(to_matrix(np.array(marker.quaternion)), pose.rotation(marker.name), atol=1e-9)


def test_nothing_is_said_before_every_part_has_reported(run: Stage) -> None:
    run.sim.new_run()
    run.sim.silent = {"head"}
    before = len(run.forces)
    for _ in range(3):
        run.sim.tick()
    wait_for(lambda: run.rig.stat("model").ready, "an answer")  # the ticks have been handled by now
    assert len(run.forces) == before
    run.sim.silent = set()
    run.tick()


def test_each_parts_age_is_told_and_grows_while_it_is_silent(run: Stage) -> None:
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


def test_a_new_run_forgets_what_was_perceived(run: Stage) -> None:
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


# The world


def test_objects_to_be_perceived_are_not_known_beforehand(run: Stage) -> None:
    file = load_world("table").objects
    assert {name for name, thing in file.items() if thing.role == "target"} == {"ball"}
    assert set(run.world()) == set(file) - {"ball"}


def test_what_is_perceived_is_known_until_it_was_not_seen_for_long_enough(run: Stage) -> None:
    events = run.rig.record(keys.event("model"), Event)
    run.perceive([-0.3, 0.1, 0.0], valid_for=20)
    wait_for(lambda: "ball" in run.world(), "the ball")
    ball = run.world()["ball"]
    assert (ball.role, ball.position, ball.geometry) == ("target", [-0.3, 0.1, 0.0], BALL)
    for _ in range(15):
        run.tick()
    run.perceive([-0.3, 0.2, 0.0], valid_for=20)
    wait_for(lambda: run.world()["ball"].position == [-0.3, 0.2, 0.0], "its move")
    for _ in range(20):
        run.tick()
    assert "ball" in run.world()  # seen again in time
    run.tick()
    assert "ball" not in run.world()
    wait_for(lambda: [e for e in events if e.code == "expired"], "the event")


def test_a_perceived_object_is_felt(run: Stage) -> None:
    palm = library().evaluate(run.rig.robot.home).position("left_palm")
    assert "ball" not in run.tick().touched.get("left_arm", [])
    run.perceive(palm.tolist())
    wait_for(lambda: "ball" in run.world(), "the ball")
    assert "ball" in run.tick().touched["left_arm"]


def test_perception_never_makes_an_object_vanish_that_it_did_not_bring(run: Stage) -> None:
    table = run.world()["table"]
    run.perceive(table.position, valid_for=1, name="table", geometry=table.geometry, role="obstacle")
    run.perceive([-0.4, 0.1, 0.3], valid_for=3)
    wait_for(lambda: "ball" in run.world(), "the ball")
    run.edit("add", AddObject, name="ball", geometry=BALL, position=[-0.5, 0.0, 0.3], quaternion=UPRIGHT, role="obstacle")
    run.perceive([-0.5, 0.1, 0.3], valid_for=1)
    wait_for(lambda: run.world()["ball"].position == [-0.5, 0.1, 0.3], "the move")
    for _ in range(5):
        run.tick()
    assert {"table", "ball"} <= set(run.world())
    run.edit("remove", OneName, name="ball")


def test_perceived_nonsense_is_refused_and_counted(run: Stage) -> None:
    run.rig.call(keys.service_rpc("model", "mark"), Empty, Done)
    run.perceive([-0.3, 0.0, 0.0], quaternion=[0.0] * 4)
    run.perceive([-0.3, 0.0, 0.0], geometry=Geometry(kind="box", size=[0.1]))
    wait_for(lambda: run.rig.stat("model").rejected.get("world") == 2, "the refusals")
    assert "ball" not in run.world()


def test_the_world_is_edited_by_calls(run: Stage) -> None:
    box = Geometry(kind="box", size=[0.1, 0.2, 0.3])
    run.edit("add", AddObject, name="crate", geometry=box, position=[-0.5, 0.0, 0.5], quaternion=UPRIGHT, role="obstacle")
    assert run.world()["crate"] == ObjectState(
        name="crate", geometry=box, position=[-0.5, 0.0, 0.5], quaternion=UPRIGHT, role="obstacle", link=""
    )
    half = [0.5**0.5, 0.0, 0.0, 0.5**0.5]
    run.edit("move", MoveObject, name="crate", position=[-0.6, 0.0, 0.5], quaternion=half)
    run.edit("move", MoveObject, name="crate", position=[-0.7, 0.0, 0.5])
    run.edit("role", SetRole, name="crate", role="ghost")
    crate = run.world()["crate"]
    assert (crate.position, crate.role) == ([-0.7, 0.0, 0.5], "ghost")
    np.testing.assert_allclose(crate.quaternion, half, atol=1e-9)
    run.edit("add", AddObject, name="crate", geometry=BALL, position=[0.0, 0.0, 1.0], quaternion=UPRIGHT, role="obstacle")
    assert run.world()["crate"].geometry == BALL
    run.edit("remove", OneName, name="crate")
    assert "crate" not in run.world()


def test_edits_from_several_callers_are_felt_by_the_very_next_tick_while_ticks_go_on(run: Stage) -> None:
    palm = library().evaluate(run.rig.robot.home).position("left_palm").tolist()
    away = [-0.9, 0.0, 0.9]

    def is_felt(name: str) -> bool:
        """In the answer to the first tick that begins from now on."""
        seen, k = len(run.contacts), run.rig.bus.k
        answer = wait_for(lambda: next((c for c in run.contacts[seen:] if c.re_k > k), None), f"a tick after {k}")
        return name in {contact.second for contact in answer.contacts}

    def edit(name: str) -> bool:
        for _ in range(5):
            run.edit("add", AddObject, name=name, geometry=BALL, position=palm, quaternion=UPRIGHT, role="obstacle")
            assert is_felt(name)
            run.edit("role", SetRole, name=name, role="ghost")
            assert not is_felt(name)
            run.edit("role", SetRole, name=name, role="target")
            assert is_felt(name)
            run.edit("move", MoveObject, name=name, position=away)
            assert not is_felt(name)
            run.edit("move", MoveObject, name=name, position=palm)
            assert is_felt(name)
            run.edit("remove", OneName, name=name)
            assert not is_felt(name)
        return True

    with ThreadPoolExecutor() as callers:
        edits = [callers.submit(edit, f"ball {number}") for number in range(4)]
        while not all(done.done() for done in edits):
            run.tick()
    assert all(done.result() for done in edits)
    assert set(run.world()) == set(library().world.objects)


def test_an_attached_object_goes_with_its_link_and_stays_where_it_is_detached(run: Stage) -> None:
    robot, model = run.rig.robot, library()
    palm = model.evaluate(robot.home).position("left_palm")
    run.tick()
    run.edit("add", AddObject, name="cup", geometry=BALL, position=palm.tolist(), quaternion=UPRIGHT, role="ghost")
    run.edit("attach", Attach, name="cup", link="l_hand")
    q = robot.home.copy()
    q[robot.part("left_arm").slice][:4] = np.deg2rad([-30.0, 40.0, 10.0, 60.0])
    run.at(q)
    there = model.evaluate(q).position("left_palm")
    assert np.linalg.norm(there - palm) > 0.05
    assert run.world()["cup"].link == "l_hand"
    np.testing.assert_allclose(run.world()["cup"].position, there, atol=1e-9)
    run.edit("detach", OneName, name="cup")
    run.at(robot.home)
    np.testing.assert_allclose(run.world()["cup"].position, there, atol=1e-9)
    run.edit("remove", OneName, name="cup")


@pytest.mark.parametrize(
    ("verb", "request_type", "fields", "says"),
    [
        ("move", MoveObject, {"name": "tabel", "position": [0.0, 0.0, 0.0]}, "Did you mean 'table'?"),
        ("remove", OneName, {"name": "none"}, "Valid: .*table"),
        ("role", SetRole, {"name": "none", "role": "ghost"}, "unknown world object"),
        ("attach", Attach, {"name": "table", "link": "l_hnad"}, "Did you mean 'l_hand'?"),
        ("detach", OneName, {"name": "table"}, "not attached"),
        ("move", MoveObject, {"name": "table", "position": [0.0] * 3, "quaternion": [0.0] * 4}, "quaternion"),
        (
            "add",
            AddObject,
            {"name": "x", "geometry": Geometry(kind="capsule", size=[0.1]), "position": [0.0] * 3, "quaternion": UPRIGHT, "role": "ghost"},
            "2 lengths",
        ),
    ],
)
def test_a_wrong_edit_is_refused_with_what_is_valid(run: Stage, verb: str, request_type: type, fields: dict[str, Any], says: str) -> None:
    before = run.world()
    with pytest.raises(CallFailed, match=says) as caught:
        run.edit(verb, request_type, **fields)
    assert caught.value.code == "world"
    assert run.world() == before


# Jacobians


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


# Harm


def test_random_bytes_and_absurd_numbers_harm_nothing(run: Stage, rng: np.random.Generator) -> None:
    targets = [keys.CLOCK, keys.TICK, keys.world("ball"), keys.world_rpc("add"), keys.MODEL_JACOBIAN]
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


# Other settings


def test_without_contact_forces_contacts_are_told_and_not_felt(tmp_path_factory: pytest.TempPathFactory) -> None:
    with rig(tmp_path_factory.mktemp("numb"), load_robot("icub")) as made:
        numb = staged(made, "--no-contact-forces")
        answer = numb.at(on_the_table())
        assert np.abs(answer.collision).max() == 0.0
        assert np.abs(answer.limits).max() + np.abs(answer.constraints).max() > 0.0
        assert answer.touched["left_arm"] == ["table"]
        assert numb.contacts[-1].contacts
        assert numb.numbers()["table_ticks"] == 1
        assert numb.model.stop() == 0


def test_the_published_propagation_spares_the_torso(tmp_path_factory: pytest.TempPathFactory) -> None:
    q, robot = on_the_table(), load_robot("icub")
    with rig(tmp_path_factory.mktemp("part"), robot) as made:
        answer = staged(made, "--propagate", "part", "--gains", "default").at(q)
        expected = constraint_forces(library().evaluate(q), Gains.default(), "part")
        np.testing.assert_allclose(answer.collision, expected.collision, atol=1e-12)


def test_a_world_that_is_not_there_is_told_in_one_line(stage: Stage) -> None:
    start = time.monotonic()
    program = stage.rig.spawn("-m", "services.model", "--endpoint", stage.rig.endpoint, "--world", "tabel")
    assert program.wait(20.0) == 2
    assert "Did you mean 'table'?" in program.says
    assert "Traceback" not in program.says
    print(f"refused after {time.monotonic() - start:.1f} s")
