# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest
import zenoh

from bus_schema.page import streams
from services.recorder.node import FOR_SUBSCRIBERS, PER_TICK, frequent_keys, queues


@pytest.mark.parametrize("locked", [False, True])
def test_every_recorded_stream_has_a_queue_and_a_long_one_if_it_has_a_message_per_tick(locked: bool) -> None:
    found = queues(everything=True, locked=locked)
    assert found.keys() == {cls.stream.keys() for cls in streams()}
    assert found.keys() - queues(everything=False, locked=locked).keys() == {cls.stream.keys() for cls in FOR_SUBSCRIBERS}
    longest = max(found.values())
    for cls in streams():
        often = cls.stream.when.startswith(("every tick", "at once after a change", "while a behaviour")) or cls in PER_TICK
        assert (found[cls.stream.keys()] == longest) == often, cls


@pytest.mark.parametrize("everything", [True, False])
def test_frequent_keys_add_no_stream(everything: bool) -> None:
    """A subscription of a stream for subscribers would let robot_sim publish it."""
    recorded = [zenoh.KeyExpr(key) for key in queues(everything, locked=False)]
    frequent = frequent_keys(["left_arm", "head"], everything)
    assert {"model/forces", "left_arm/motion", "head/motion"} <= set(frequent)
    assert ("head/state" in frequent) is everything
    for key in frequent:
        assert any(one.includes(zenoh.KeyExpr(key)) for one in recorded), key
