# SPDX-License-Identifier: Apache-2.0
"""The copies for viewers, read by programs of others."""

from __future__ import annotations

import json
from pathlib import Path

import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from bus_schema import VERSION, encode, encoding_of
from bus_schema.messages import Event, PartStatus, Served, Tick
from mobee import Model, load_robot
from mobee.arrays import Array
from mobee.model.kinematics import matrix_from_quaternion
from services.common.tap import Raw
from services.recorder import ros
from services.recorder.files import Files
from services.recorder.views import Copy, Views

ROBOT = load_robot("icub")
HEADER = {"v": VERSION, "run": "run_1", "src": "robot_sim", "seq": 0, "k": 7, "t": 1_500_000_002, "tw": 0}


def raw(message: Tick | Event | Served, key: str, at: int = 0) -> Raw:
    return Raw(key, encoding_of(type(message)), encode(message), at, at)


def tick_at(q: Array) -> Tick:
    parts = dict.fromkeys(ROBOT.parts, PartStatus(7, 0, "velocity", "armed", 0, 1, 1, 1))
    return Tick(**HEADER, dt=10_000_000, mode="free", rate=1.0, q=q.tolist(), parts=parts)


def copies(message: Raw) -> list[Copy]:
    return list(Views(ROBOT, 10.0, 2.0).of(message, message.type))


def test_ros_messages_hold_the_motors_and_the_links(tmp_path: Path) -> None:
    q = ROBOT.limits[:, 0] + np.random.default_rng(0).uniform(size=len(ROBOT.motors)) * np.ptp(ROBOT.limits, axis=1)
    files = Files(tmp_path, 10**9, {})
    for channel, data in copies(raw(tick_at(q), "tick")):
        files.write(channel, data, 1, 1)
    files.close()
    with (tmp_path / "messages-0000.mcap").open("rb") as file:
        decoded = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/joint_states", "/tf"])
        found = {channel.topic: message for _, channel, _, message in decoded}
    joints, transforms = found["/joint_states"], found["/tf"].transforms
    assert (joints.header.stamp.sec, joints.header.stamp.nanosec) == (1, 500_000_002)
    assert joints.name == list(ROBOT.motors)
    assert joints.position == q.tolist()
    assert [one.child_frame_id for one in transforms] == list(ROBOT.links)
    poses = Model(ROBOT).evaluate(q).transforms
    for one, pose in zip(transforms, poses, strict=True):
        place, turn = one.transform.translation, one.transform.rotation
        np.testing.assert_array_equal([place.x, place.y, place.z], pose[:3, 3])
        np.testing.assert_allclose(matrix_from_quaternion(np.array([turn.w, turn.x, turn.y, turn.z])), pose[:3, :3], atol=1e-12)
        assert (one.header.stamp.sec, one.header.frame_id) == (1, "root_frame")


def test_json_copies_are_as_the_schema_says() -> None:
    event = Event(**HEADER, level="info", code="armed", text="torso is under control", values={"epoch": 3.0})
    ((channel, data),) = copies(raw(event, "event/controller"))
    assert channel.topic == "json/event/controller" and channel.schema_encoding == "jsonschema"
    schema = json.loads(channel.definition)["$defs"]["Event"]
    content = json.loads(data)
    assert content["text"] == event.text and content.keys() == schema["properties"].keys()


def test_calls_are_shown_with_their_requests() -> None:
    from bus_schema.rpc import Done, WithEpoch

    request, reply = encode(WithEpoch(v=VERSION, id="1", who="agent_torso", epoch=5)), encode(Done(v=VERSION))
    served = Served(**HEADER, key="torso/rpc/release", request=request, request_type="WithEpoch", reply=reply, reply_type="Done")
    ((_, data),) = copies(raw(served, "served/controller"))
    assert json.loads(data)["request"] == {"v": VERSION, "id": "1", "who": "agent_torso", "epoch": 5}


def test_streams_are_copied_at_a_bounded_rate_and_events_always() -> None:
    views, q = Views(ROBOT, 10.0, 2.0), ROBOT.home
    ticks = [raw(tick_at(q), "tick", at) for at in range(0, 1_000_000_000, 10_000_000)]
    topics = [channel.topic for tick in ticks for channel, _ in views.of(tick, "Tick")]
    assert (topics.count("/joint_states"), topics.count("/tf"), topics.count("json/tick")) == (10, 10, 2)
    event = raw(Event(**HEADER, level="info", code="a", text="", values={}), "event/a")
    assert sum(1 for _ in range(20) for _ in views.of(event, "Event")) == 20


@pytest.mark.parametrize("payload", [b"", b"\x00", b"\xc1", b"\x81" * 5000, encode(tick_at(ROBOT.home))[:-7]])
def test_a_message_that_cannot_be_decoded_has_no_copy(payload: bytes) -> None:
    assert copies(Raw("tick", encoding_of(Tick), payload, 0, 0)) == []


def test_a_tick_at_a_time_that_ros_cannot_state_has_no_ros_messages() -> None:
    tick, cdr = tick_at(ROBOT.home), {"/joint_states", "/tf"}
    for t, topics in ((ros.END_OF_TIME - 1, {*cdr, "json/tick"}), (ros.END_OF_TIME, {"json/tick"}), (2**62, {"json/tick"})):
        assert {channel.topic for channel, _ in copies(raw(msgspec.structs.replace(tick, t=t), "tick"))} == topics
