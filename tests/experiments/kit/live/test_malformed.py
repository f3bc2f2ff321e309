# SPDX-License-Identifier: Apache-2.0
"""Messages that are nearly valid: most can be decoded, and no reader of any message raises what its callers do not expect."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress

import pytest

from bus_schema import Refused, decode, type_of
from bus_schema.page import streams
from bus_schema.rpc import CALLS
from experiments.kit.live.malformed import Drawer
from mobee import load_robot
from services.common.observe import Received
from services.common.tap import Raw
from services.recorder.node import sender_of
from services.recorder.views import Views

ROBOT = load_robot("icub")
PARTS = {name: len(part) for name, part in ROBOT.parts.items()}
COUNT = 3000


@pytest.fixture
def drawer() -> Drawer:
    return Drawer(1, PARTS)


def test_the_same_seed_draws_the_same_tokens_and_keys() -> None:
    first, second = Drawer(3, PARTS), Drawer(3, PARTS)
    assert [first.token() for _ in range(9)] == [second.token() for _ in range(9)]
    assert [first.request().key for _ in range(9)] == [second.request().key for _ in range(9)]


def test_of_every_stream_and_call_most_can_be_decoded_and_some_cannot(drawer: Drawer) -> None:
    types = {cls.__name__: cls for cls in (*streams(), *(call.request for call in CALLS))}
    drawn, decoded = Counter[str](), Counter[str]()
    for number in range(2 * COUNT):
        one = drawer.request() if number % 2 else drawer.message()
        name = type_of(one.encoding)
        drawn[name] += 1
        with suppress(Refused):
            decode(types[name], one.payload, one.encoding)
            decoded[name] += 1
    assert drawn.keys() == types.keys()
    assert decoded.keys() == types.keys()
    assert 0.6 < decoded.total() / drawn.total() < 0.95


def test_observer_and_recorder_read_or_refuse_every_message(drawer: Drawer) -> None:
    views, without_number = Views(ROBOT, 1e9, 1e9), 0
    for number in range(COUNT):
        one = drawer.message()
        list(views.of(Raw(one.key, one.encoding, one.payload, number, number), type_of(one.encoding)))
        without_number += sender_of(one.payload) is None
        with suppress(ValueError):
            Received(one.key, one.encoding, one.payload, 0.0).content()
    assert 0 < without_number < COUNT / 5


@pytest.mark.parametrize("payload", [b"", b"\xc1", b"\x81\xa3src\xa1\xff", b"\x81\xa3seq\xcf" + b"\xff" * 8])
def test_a_message_that_services_refuse_has_no_number(payload: bytes) -> None:
    assert sender_of(payload) is None
