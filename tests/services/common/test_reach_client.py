# SPDX-License-Identifier: Apache-2.0
"""The world that a plant on the bus gives to the model, and the errors if this is impossible."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from bus_schema import VERSION
from bus_schema.messages import Geometry
from bus_schema.rpc import Done, ObjectState, World
from mobee import ActionInterrupted, InvalidValue, ReachTarget, UnknownName
from mobee.reach import TARGET
from services.common.reach_client import ReachClient
from services.common.rpc import CallFailed

UPRIGHT = [1.0, 0.0, 0.0, 0.0]
AT = [-0.3, 0.2, 0.1]


class FakeService:
    """Takes note of the calls to the model, and answers or fails."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, dict[str, Any]]] = []
        self.failure: CallFailed | None = None
        self.objects: list[ObjectState] = []
        self.stale: dict[str, float] = {}
        self.alive = lambda who, instance, up: None

    def on_newest(self, *_: Any, **__: Any) -> None:
        """No stream comes."""

    def on_alive(self, handler: Any) -> None:
        self.alive = handler

    def call(self, key: str, request: type, reply: type, *, tries: int, **fields: Any) -> Any:
        self.calls.append((key.rpartition("/")[2], fields))
        if self.failure is not None:
            raise self.failure
        return World(v=VERSION, objects=self.objects, stale=self.stale) if reply is World else Done(v=VERSION)


@pytest.fixture
def service() -> FakeService:
    return FakeService()


@pytest.fixture
def client(service: FakeService) -> ReachClient:
    return ReachClient(service, ("right_arm",))  # type: ignore[arg-type]  # a service without a bus


def thing(name: str, kind: str, size: list[float], role: str = "target") -> ObjectState:
    return ObjectState(name=name, geometry=Geometry(kind=kind, size=size), position=AT, quaternion=UPRIGHT, role=role, link="")


def test_a_target_is_put_moved_and_taken_away(service: FakeService, client: ReachClient) -> None:
    client.present(ReachTarget(np.array(AT), radius=0.04))
    client.present(ReachTarget(np.zeros(3), radius=0.04))
    client.present(None)
    client.present(None)
    assert [verb for verb, _ in service.calls] == ["add", "add", "remove"]
    added = service.calls[0][1]
    assert (added["name"], added["position"], added["geometry"].size, added["role"]) == (TARGET, AT, [0.04], "target")


def test_a_reach_request_names_the_presented_target(client: ReachClient) -> None:
    with pytest.raises(InvalidValue, match=r"no target is presented.* present\(ReachTarget"):
        client.asked()
    client.present(ReachTarget(np.array(AT), aim="surface", normal=np.array([0.0, 0.0, 2.0])))
    expected = {"object": TARGET, "position": AT, "radius": 0.05, "aim": "surface", "normal": [0.0, 0.0, 1.0], "faces": False}
    assert client.asked() == expected


def test_a_new_model_is_presented_the_target_again(service: FakeService, client: ReachClient) -> None:
    client.present(ReachTarget(np.array(AT)))
    client.asked()
    assert len(service.calls) == 1
    service.alive("model", "m2", True)
    client.asked()
    client.asked()
    assert [verb for verb, _ in service.calls] == ["add", "add"]


def test_a_withdrawn_target_is_presented_again_for_the_next_reach(service: FakeService, client: ReachClient) -> None:
    client.withdraw()
    client.present(ReachTarget(np.array(AT)))
    client.withdraw()
    client.withdraw()
    assert client.asked()["position"] == AT
    assert [verb for verb, _ in service.calls] == ["add", "remove", "add"]


@pytest.mark.parametrize(
    ("kind", "size", "radius"),
    [("sphere", [0.03], 0.03), ("box", [0.1, 0.2, 0.06], 0.03), ("cylinder", [0.04, 0.06], 0.03), ("capsule", [0.02, 0.3], 0.02)],
)
def test_an_object_is_reached_for_as_the_sphere_in_its_middle(
    service: FakeService, client: ReachClient, kind: str, size: list[float], radius: float
) -> None:
    service.objects = [thing("cup", kind, size)]
    target = client.present_object("cup", "surface")
    assert (target.position.tolist(), target.radius, target.aim) == (AT, pytest.approx(radius), "surface")
    assert client.asked()["object"] == "cup"
    assert [verb for verb, _ in service.calls] == ["list"]


def test_the_link_of_the_object_is_that_at_the_reach(service: FakeService, client: ReachClient) -> None:
    service.objects = [ball := thing("ball", "sphere", [0.03])]
    client.present_object("ball")
    assert client.attached_to() == ("ball", "")
    service.objects = [replace(ball, link="r_hand")]  # the hand has closed
    assert client.attached_to() == ("ball", "r_hand")
    client.present(ReachTarget(np.array(AT)))
    assert client.attached_to() == (TARGET, "")


def test_a_stale_object_is_refused_and_a_margin_of_its_shape_does_not_count(service: FakeService, client: ReachClient) -> None:
    service.stale = {"ball": 7.26}
    with pytest.raises(InvalidValue, match="'ball' is stale: the newest picture that shows it is 7.3 s old, and it may be elsewhere"):
        client.present_object("ball")
    service.objects = [replace(thing("ball", "sphere", [0.038]), margin=0.008, t_capture=5)]
    service.stale = {}
    assert client.present_object("ball").radius == pytest.approx(0.03)


def test_an_object_that_is_no_target_is_refused_with_the_valid_names(service: FakeService, client: ReachClient) -> None:
    service.objects = [thing("table", "box", [0.6, 1.5, 0.5], "obstacle"), thing("ball", "sphere", [0.03])]
    with pytest.raises(UnknownName, match="Did you mean 'ball'.*Valid: ball, table"):
        client.present_object("bal")
    with pytest.raises(InvalidValue, match="'table' has the role obstacle .* model/rpc/world/role"):
        client.present_object("table")


def test_a_refusal_is_a_wrong_value_and_silence_an_interruption(service: FakeService, client: ReachClient) -> None:
    service.failure = CallFailed("world", "'reach_target' is there for agent_left_arm")
    with pytest.raises(InvalidValue, match="there for agent_left_arm"):
        client.present(ReachTarget(np.array(AT)))
    service.failure = CallFailed("no_answer", "nobody answers")
    with pytest.raises(ActionInterrupted, match="the model does not answer"):
        client.present(ReachTarget(np.array(AT)))
    with pytest.raises(ActionInterrupted, match="does not list its objects"):
        client.present_object("ball")
    client.withdraw()  # no message is needed


def test_a_target_that_another_client_has_removed_causes_no_error(service: FakeService, client: ReachClient) -> None:
    client.present(ReachTarget(np.array(AT)))
    service.failure = CallFailed("world", "unknown world object 'reach_target'")
    client.present(None)
    with pytest.raises(InvalidValue, match="no target is presented"):
        client.asked()


def test_places_are_those_of_free_objects_that_are_not_stale(service: FakeService, client: ReachClient) -> None:
    service.objects = [thing("cup", "cylinder", [0.035, 0.09]), replace(thing("mug", "cylinder", [0.035, 0.09]), link="l_hand")]
    service.stale = {"ball": 7.26}
    assert {name: one.position for name, one in client.objects().items()} == {"cup": AT}
    service.failure = CallFailed("no_answer", "nobody answers")
    with pytest.raises(ActionInterrupted, match="does not list its objects"):
        client.objects()
