# SPDX-License-Identifier: Apache-2.0
"""The world as it is perceived, and edited by calls."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import Event, Geometry
from bus_schema.rpc import (
    AddObject,
    Attach,
    Done,
    Empty,
    MoveObject,
    ObjectState,
    OneName,
    SetRole,
)
from mobee import load_world
from services.common.rpc import CallFailed
from tests.services.harness import wait_for
from tests.services.model.stage import BALL, UPRIGHT, Stage, library


def test_objects_to_be_perceived_are_not_known_beforehand(run: Stage) -> None:
    file = load_world("table").objects
    assert {name for name, thing in file.items() if thing.role == "target"} == {"ball"}
    assert set(run.world()) == set(file) - {"ball"}


def test_a_perceived_object_expires_when_it_is_not_seen_again(run: Stage) -> None:
    events = run.rig.record(Event, "model")
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


def test_the_role_that_a_client_gives_a_perceived_object_stays_while_vision_moves_it(run: Stage) -> None:
    run.perceive([-0.3, 0.1, 0.0])
    wait_for(lambda: "ball" in run.world(), "the ball")
    run.rig.call(keys.world_rpc("role"), SetRole, Done, name="ball", role="ghost")
    run.perceive([-0.3, 0.2, 0.0])
    wait_for(lambda: run.world()["ball"].position == [-0.3, 0.2, 0.0], "its move")
    assert run.world()["ball"].role == "ghost"
    run.rig.call(keys.world_rpc("role"), SetRole, Done, name="ball", role="target")
    run.perceive([-0.3, 0.1, 0.0])
    wait_for(lambda: run.world()["ball"].position == [-0.3, 0.1, 0.0], "its move")
    assert run.world()["ball"].role == "target"


def test_perceived_objects_that_the_settings_name_are_ghosts_from_the_start_and_again_after_they_expired(run: Stage) -> None:
    for place in ([-0.3, 0.1, 0.0], [-0.3, 0.2, 0.0]):
        run.perceive(place, valid_for=2, name="saucer")
        wait_for(lambda: "saucer" in run.world(), "the saucer")
        assert run.world()["saucer"].role == "ghost"
        for _ in range(3):
            run.tick()
        assert "saucer" not in run.world()
    run.edit("add", AddObject, name="saucer", geometry=BALL, position=[-0.5, 0.0, 0.3], quaternion=UPRIGHT, role="obstacle")
    assert run.world()["saucer"].role == "obstacle"  # which a client has placed
    run.edit("remove", OneName, name="saucer")


def test_a_perceived_object_causes_contacts(run: Stage) -> None:
    palm = library().evaluate(run.rig.robot.home).position("left_palm")
    assert "ball" not in run.tick().touched.get("left_arm", [])
    run.perceive(palm.tolist())
    wait_for(lambda: "ball" in run.world(), "the ball")
    assert "ball" in run.tick().touched["left_arm"]


def test_perception_changes_only_perceived_objects(run: Stage) -> None:
    """A message of vision that names the scenario's table, or an object of a client, changes nothing, and is counted."""
    run.rig.call(keys.service_rpc("model", "mark"), Empty, Done)
    table = run.world()["table"]
    run.perceive([7.0, 0.0, 0.0], valid_for=1, name="table", geometry=Geometry(kind="sphere", size=[0.01]), role="ghost")
    run.perceive([-0.4, 0.1, 0.3], valid_for=3)
    wait_for(lambda: "ball" in run.world(), "the ball")
    run.edit("add", AddObject, name="ball", geometry=BALL, position=[-0.5, 0.0, 0.3], quaternion=UPRIGHT, role="obstacle")
    run.perceive([-0.5, 0.1, 0.3], valid_for=1)
    wait_for(lambda: run.rig.stat("model").rejected.get("authority") == 2, "the refusals")
    for _ in range(5):
        run.tick()
    assert run.world()["table"] == table and run.world()["ball"].position == [-0.5, 0.0, 0.3]
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


def test_edits_from_several_callers_take_effect_in_the_next_tick(run: Stage) -> None:
    palm = library().evaluate(run.rig.robot.home).position("left_palm").tolist()
    away = [-0.9, 0.0, 0.9]

    def has_contact(name: str) -> bool:
        """In the answer to the first tick that begins from now on."""
        seen, k = len(run.contacts), run.rig.bus.k
        answer = wait_for(lambda: next((c for c in run.contacts[seen:] if c.re_k > k), None), f"a tick after {k}")
        return name in {contact.second for contact in answer.contacts}

    def edit(name: str) -> bool:
        for _ in range(5):
            run.edit("add", AddObject, name=name, geometry=BALL, position=palm, quaternion=UPRIGHT, role="obstacle")
            assert has_contact(name)
            run.edit("role", SetRole, name=name, role="ghost")
            assert not has_contact(name)
            run.edit("role", SetRole, name=name, role="target")
            assert has_contact(name)
            run.edit("move", MoveObject, name=name, position=away)
            assert not has_contact(name)
            run.edit("move", MoveObject, name=name, position=palm)
            assert has_contact(name)
            run.edit("remove", OneName, name=name)
            assert not has_contact(name)
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


@pytest.mark.parametrize("radius", [0.03, 0.04])
def test_an_object_that_is_added_replaces_an_attached_one_and_is_free(run: Stage, radius: float) -> None:
    cup = {"name": "cup", "quaternion": UPRIGHT, "role": "ghost"}
    run.edit("add", AddObject, geometry=BALL, position=[-0.3, 0.0, 0.2], **cup)
    run.edit("attach", Attach, name="cup", link="l_hand")
    run.edit("add", AddObject, geometry=Geometry(kind="sphere", size=[radius]), position=[-0.4, 0.1, 0.2], **cup)
    found = run.world()["cup"]
    assert (found.link, found.position, found.geometry.size) == ("", [-0.4, 0.1, 0.2], [radius])
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
        (
            "add",
            AddObject,
            {
                "name": "table",
                "geometry": Geometry(kind="sphere", size=[1e7]),
                "position": [0.0] * 3,
                "quaternion": UPRIGHT,
                "role": "ghost",
            },
            "lengths of 1e-09 to 100000 m",
        ),
    ],
)
def test_a_wrong_edit_is_refused_with_what_is_valid(run: Stage, verb: str, request_type: type, fields: dict[str, Any], says: str) -> None:
    before = run.world()
    with pytest.raises(CallFailed, match=says) as caught:
        run.edit(verb, request_type, **fields)
    assert caught.value.code == "world"
    assert run.world() == before


def test_a_perceived_shape_is_enlarged_by_its_uncertainty_in_steps(run: Stage) -> None:
    """By two standard deviations; a little more or less of them changes no shape."""
    largest = 0.004**2
    run.perceive([-0.3, 0.1, 0.0], covariance=np.diag([1e-6, largest, 1e-6]).ravel().tolist())
    wait_for(lambda: "ball" in run.world(), "the ball")
    ball = run.world()["ball"]
    assert ball.geometry.size == [pytest.approx(0.03 + 0.008)] and ball.margin == pytest.approx(0.008) and ball.t_capture == run.rig.bus.t
    run.perceive([-0.3, 0.2, 0.0], covariance=(0.8 * largest * np.eye(3)).ravel().tolist())
    wait_for(lambda: run.world()["ball"].position == [-0.3, 0.2, 0.0], "its move")
    assert run.world()["ball"].margin == ball.margin
    cup = Geometry(kind="cylinder", size=[0.035, 0.09])
    run.perceive([-0.3, 0.2, 0.0], geometry=cup, covariance=(largest * np.eye(3)).ravel().tolist())
    wait_for(lambda: run.world()["ball"].geometry.kind == "cylinder", "its new shape")
    assert run.world()["ball"].geometry.size == [pytest.approx(0.043), pytest.approx(0.106)]


@pytest.mark.parametrize(
    "change", [{"valid_for": -1}, {"covariance": (0.05**2 * np.eye(3)).ravel().tolist()}], ids=["withdrawn", "uncertain"]
)
def test_an_object_that_vision_withdraws_or_hardly_knows_is_stale_at_once(run: Stage, change: dict[str, Any]) -> None:
    events = run.rig.record(Event, "model")
    seen_at = run.rig.bus.t
    run.perceive([-0.3, 0.1, 0.0])
    wait_for(lambda: "ball" in run.world(), "the ball")
    assert run.listed().stale == {}
    run.tick()
    run.perceive([-0.3, 0.1, 0.0], t_capture=seen_at, **change)
    wait_for(lambda: "ball" not in run.world(), "its removal")
    assert run.listed().stale == {"ball": pytest.approx(1e-9 * (run.rig.bus.t - seen_at))}
    wait_for(lambda: [e for e in events if e.code == "expired"], "the event")
    run.perceive([-0.3, 0.1, 0.0])
    wait_for(lambda: "ball" in run.world(), "the ball again")
    assert run.listed().stale == {}


def test_a_client_that_adds_a_perceived_object_gives_it_the_role(run: Stage) -> None:
    run.perceive([-0.3, 0.1, 0.0])
    wait_for(lambda: "ball" in run.world(), "the ball")
    run.edit("role", SetRole, name="ball", role="ghost")
    for _ in range(2):
        run.edit("add", AddObject, name="ball", geometry=BALL, position=[-0.5, 0.0, 0.3], quaternion=UPRIGHT, role="obstacle")
        assert run.world()["ball"].role == "obstacle"
    run.edit("remove", OneName, name="ball")
    run.perceive([-0.3, 0.1, 0.0])
    wait_for(lambda: "ball" in run.world(), "the ball again")
    assert run.world()["ball"].role == "target"


def perceived_in_hand(run: Stage) -> None:
    run.perceive([-0.3, 0.1, 0.0], valid_for=20)
    wait_for(lambda: "ball" in run.world(), "the ball")
    run.edit("attach", Attach, name="ball", link="l_hand")


def test_a_new_run_forgets_also_a_perceived_object_that_is_attached(run: Stage) -> None:
    perceived_in_hand(run)
    run.sim.new_run()
    run.tick()
    assert "ball" not in run.world()


@pytest.mark.parametrize(
    "change", [{}, {"covariance": (0.01**2 * np.eye(3)).ravel().tolist()}, {"valid_for": -1}], ids=["same", "less certain", "withdrawn"]
)
def test_vision_does_not_move_detach_or_remove_an_attached_object(run: Stage, change: dict[str, Any]) -> None:
    perceived_in_hand(run)
    before = run.world()["ball"]
    run.tick()
    run.perceive([-0.5, 0.1, 0.0], **change)
    wait_for(lambda: run.world()["ball"].t_capture == run.rig.bus.t, "the message")
    run.tick()
    after = run.world()["ball"]
    assert (after.link, after.position, after.margin) == ("l_hand", before.position, before.margin)


@pytest.mark.parametrize(("valid_for", "ticks"), [(None, 20), (40, 41), (-1, 1)], ids=["not seen again", "seen", "withdrawn"])
def test_a_detached_object_expires_as_vision_said_last(run: Stage, valid_for: int | None, ticks: int) -> None:
    perceived_in_hand(run)
    run.tick()
    if valid_for is not None:
        run.perceive([-0.3, 0.1, 0.0], valid_for=valid_for)
        wait_for(lambda: run.world()["ball"].t_capture == run.rig.bus.t, "the message")
    if valid_for == -1:
        run.tick()
        assert "ball" in run.world()
    run.edit("detach", OneName, name="ball")
    for _ in range(ticks - 1):
        run.tick()
        assert "ball" in run.world()
    run.tick()
    assert "ball" not in run.world()


def test_an_attached_object_stays_however_long_it_is_not_seen(run: Stage) -> None:
    perceived_in_hand(run)
    for _ in range(25):
        run.tick()
    assert run.world()["ball"].link == "l_hand"
    run.edit("detach", OneName, name="ball")
    run.tick()
    assert "ball" not in run.world()
